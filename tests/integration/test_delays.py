"""A delay runs from the application's hand-over to the other application's receipt, and its parts add up to it."""

from collections.abc import Callable

import pytest

from fanet_mw.scenario import Scenario
from fanet_mw.trace import Delivered, Generated
from fanet_mw.units import MS
from sim.results.files import finish
from sim.results.metrics import PARTS
from sim.results.outcome import Outcome
from sim.run.virtual import simulate

LEAD_MS, HANDOVER_MS = 40, 20


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    from sim.scenarios import catalog

    keys = ("nodes.count=6", f"radio.lead_ms={LEAD_MS}", f"radio.handover_ms={HANDOVER_MS}", "mission.survivors=4")
    return simulate(catalog.find("quick", [*keys, "duration_s=20"]))


def test_a_delivery_is_the_receipt_and_its_delay_begins_with_the_hand_over(outcome: Outcome) -> None:
    born = {(r.node, r.seq): r for r in outcome.records if isinstance(r, Generated)}
    delivered = [r for r in outcome.records if isinstance(r, Delivered)]
    assert {born[r.origin, r.seq].app for r in delivered} == {"traffic", "report"}
    for record in delivered:
        assert record.delay_ns == record.t_ns - born[record.origin, record.seq].t_ns
        assert record.delay_ns > LEAD_MS * MS, "nothing is on the air sooner than one lead after its hand-over"
        assert record.t_ns % (HANDOVER_MS * MS) == 0, "receptions are handed over in batches"
        assert 0 <= record.handover_ns < HANDOVER_MS * MS
    assert max(record.handover_ns for record in delivered) > HANDOVER_MS * MS / 2


@pytest.mark.parametrize("app", ["traffic", "reports"])
def test_the_parts_of_a_delay_add_up_to_it(outcome: Outcome, app: str) -> None:
    summary = finish(outcome, out=None)
    figures = summary if app == "traffic" else summary[app]
    parts = figures["delay_parts_ms"]
    assert list(parts) == list(PARTS)
    assert sum(parts.values()) == pytest.approx(figures["delay_ms"]["mean"], abs=0.01)
    assert parts["lead"] == LEAD_MS
    assert 0 < parts["handover"] < HANDOVER_MS
    assert parts["air"] > 1, "a frame of 1 kB lasts a millisecond"


def test_without_a_lead_and_handover_these_parts_are_nothing(make_scenario: Callable[..., Scenario]) -> None:
    keys = {"routing.protocol": "flooding", "radio.lead_ms": 0, "nodes.count": 5}
    summary = finish(simulate(make_scenario(**keys)), out=None)
    assert summary["delivered"] > 0
    assert summary["delay_parts_ms"]["lead"] == summary["delay_parts_ms"]["handover"] == 0
