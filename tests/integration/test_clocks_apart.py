"""Clocks that the limit keeps apart: nobody states a bound while a node that it counts on is out of step."""

import pytest
from kit import slow

from fanet_mw.scenario import Scenario, config
from fanet_mw.units import NodeId
from sim.planner.plan import plan
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.world.environment.layout import positions

TREE = {
    "duration_s": 70, "warmup_s": 40, "drain_s": 5, "nodes": {"count": 6, "layout": "line", "spacing_m": 200},
    "traffic": {"sources": [2], "payload_bytes": 200},
    "clusters": {"count": 2, "flooding_period_s": 1, "relay": "scheduled", "turn_slack_us": 250, "resume": False},
}  # fmt: skip


def line(seed: int, **clock: object) -> Scenario:
    return config.build({**TREE, "seed": seed, "clock": {"drift_ppm": 20, **clock}})


@pytest.mark.parametrize(
    ("clock", "seeds"),
    [
        ({"sync": "beacons", "offset_ms": 4000}, (3,)),
        *slow(({"sync": "beacons", "offset_ms": 4000}, (4, 6)), ({"sync": "gps", "offset_ms": 7000}, (1, 3, 4))),
    ],
)
def test_nothing_is_promised_while_a_relay_refuses_the_swarms_time(clock: dict[str, object], seeds: tuple[int]) -> None:
    for seed in seeds:
        summary = finish(simulate(line(seed, **clock)), out=None)
        assert summary["pdr"] < 0.75, "a node is out of step; it hears nobody in turns, so it contends"
        assert summary["bound"].get("violations", 0) == 0
        assert summary["bound"].get("stated_share", 0) == 0


@pytest.mark.parametrize("clock", [*slow({"sync": "beacons", "offset_ms": 1000}), {"sync": "gps", "offset_ms": 4000}])
def test_clocks_within_the_limit_are_brought_together_and_all_is_promised(clock: dict[str, object]) -> None:
    bound = finish(simulate(line(3, **clock)), out=None)["bound"]
    assert (bound["stated_share"], bound["within_share"], bound["violations"]) == (1.0, 1.0, 0)


@pytest.mark.parametrize(
    ("clock", "said"),
    [
        ({"sync": "beacons", "offset_ms": 20000}, "clocks may be 40.0028 s apart"),
        ({"sync": "gps", "offset_ms": 20000}, "clocks may be 20.0014 s apart"),
        ({"sync": "beacons", "offset_ms": 2498}, None),
        ({"sync": "gps", "offset_ms": 4998}, None),
        ({"sync": "gps", "offset_ms": 4999}, "clock.limit_s = 5"),
    ],
)
def test_a_plan_says_what_offsets_beyond_the_limit_do(clock: dict[str, object], said: str | None) -> None:
    scenario = line(1, **clock)
    found = plan(scenario, {NodeId(n): at for n, at in enumerate(positions(scenario), 1)})
    assert found.feasible == (said is None), found.problems
    assert said is None or any(said in problem for problem in found.problems)
