"""How much traffic a plan of rounds counts, for sources of every kind."""

import json
from typing import Any

import pytest

from fanet_mw.scenario import config
from sim.planner.answer import judge

URGENT = {"payload_bytes": 400, "priority": "report"}


def planned(**traffic: Any) -> tuple[str, dict[str, Any], bool]:
    tree = {"nodes": {"count": 9}, "routing": {"protocol": "rounds"}, "world": {"area_m": 600}, "traffic": traffic}
    text, content, feasible = judge(config.build(tree))
    json.loads(json.dumps(content, allow_nan=False))
    return " ".join(text.split()), content, feasible


@pytest.mark.parametrize("traffic", [{}, URGENT])
def test_saturated_sources_are_carried_by_nothing(traffic: dict[str, Any]) -> None:
    text, content, feasible = planned(arrivals="saturated", **traffic)
    assert not feasible
    (problem,) = content["problems"]
    assert problem.startswith("traffic: saturated sources offer more than any turns or slots carry")
    assert "% full" not in text


def test_a_trace_counts_with_the_packets_that_it_has_and_not_with_an_interval() -> None:
    packets = tuple((index / 100, 1024) for index in range(1, 1001))  # 100 a second
    _, trace, _ = planned(arrivals="trace", packets=packets)
    _, cbr, _ = planned(arrivals="cbr", interval_s=0.01)
    assert trace["bulk"]["needed"] == pytest.approx(cbr["bulk"]["needed"])
    urgent = tuple((index / 10, 400) for index in range(1, 101))
    _, trace, _ = planned(**{**URGENT, "arrivals": "trace", "packets": urgent})
    _, cbr, _ = planned(**{**URGENT, "interval_s": 0.1})
    assert trace["offered_bytes_per_s"] == pytest.approx(cbr["offered_bytes_per_s"])


def test_sources_that_pause_count_as_if_they_did_not() -> None:
    _, on_off, _ = planned(arrivals="on_off", on_s=1.0, off_s=9.0)
    _, cbr, _ = planned(arrivals="cbr")
    assert on_off["bulk"]["needed"] == cbr["bulk"]["needed"]
