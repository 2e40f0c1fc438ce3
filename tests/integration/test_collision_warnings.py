"""Whole swarms on courses that meet: UAVs that do not see each other pass clear because they were warned."""

from typing import Any

import pytest
from kit import slow

from fanet_mw import mavlink
from fanet_mw.errors import ConfigError
from fanet_mw.scenario.config import build
from fanet_mw.trace import ConflictForeseen, ConflictOver, Warned
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.virtual import simulate
from sim.scenarios import catalog

PAIR = [[300, 0, 50], [-300, 0, 50]]
ABOVE = [0, 60, 120]


def flown(
    places: list[list[int]], *settings: str, faults: tuple[dict[str, Any], ...] = ()
) -> tuple[Outcome, dict[str, Any]]:
    scenario = catalog.find(
        "crossing",
        [
            f"nodes.count={len(places)}", 'nodes.layout="explicit"', f"nodes.positions_m={places}", "clusters.count=1",
            'mobility.model="crossing"', "mission.survivors=0", "duration_s=32", "warmup_s=5", "drain_s=1",
            "radio.range_m=500", *settings,
        ],
    )  # fmt: skip
    outcome = simulate(build(scenario.model_dump(exclude_none=True) | {"faults": faults}))
    return outcome, finish(outcome, out=None)


def test_two_that_meet_head_on_hit_without_warnings_and_pass_clear_with_them() -> None:
    _, blind = flown(PAIR, "mission.collision_horizon_s=0")
    assert blind["separation"] == {**blind["separation"], "losses": 1, "foreseen": 0, "warnings": 0}
    assert blind["separation"]["least_m"] < 1
    outcome, warned = flown(PAIR)
    assert warned["separation"]["least_m"] > 15
    assert warned["separation"]["losses"] == 0
    for kind in (ConflictForeseen, ConflictOver):
        assert {r.node for r in outcome.records if isinstance(r, kind)} == {1, 2}
    said = [r for r in outcome.records if isinstance(r, Warned)]
    assert {(r.node, r.other) for r in said} <= {(1, 2), (2, 1)}
    assert warned["warnings"]["generated"] == warned["separation"]["warnings"] == len(said) > 0
    assert warned["warnings"]["pdr"] == warned["separation"]["reached_the_other"] == 1
    heard = [m for _, data in outcome.taps for m in mavlink.decode(data) if m.get_type() == "COLLISION"]
    assert len(heard) == len(said)


@pytest.mark.parametrize("protocol", ["flooding", *slow("aodv", "direct", "gossip", "counter")])
def test_two_that_foresee_the_same_at_the_same_fix_of_gps_do_not_warn_at_the_same_instant(protocol: str) -> None:
    _, summary = flown(PAIR, f"routing.protocol={protocol}", "traffic.arrivals=none")
    assert summary["separation"]["warnings"] > 2
    assert summary["warnings"]["pdr"] == 1


@pytest.mark.slow
def test_who_does_not_hear_the_other_is_told_of_it_over_a_third() -> None:
    deaf = {"at_s": 0, "kind": "degrade", "src": 2, "dst": 1, "both": False, "loss_share": 1.0}
    outcome, summary = flown([*PAIR, ABOVE], faults=(deaf,))
    foreseen = [r for r in outcome.records if isinstance(r, ConflictForeseen)]
    assert {(r.node, r.other, r.told) for r in foreseen} == {(1, 2, True), (2, 1, False)}
    assert summary["separation"]["told"] == 1
    assert summary["separation"]["least_m"] > 15


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("mission.collision_distance_m=0", "needs mission.collision_distance_m > 0"),
        ("routing.hello_interval_s=0", "routing.hello_interval_s > 0"),
        ("nodes.altitude_m=30", "nodes.altitude_m = 30 must be > 2 x mission.collision_distance_m = 30"),
    ],
)
def test_warnings_without_what_they_need_are_refused(setting: str, said: str) -> None:
    with pytest.raises(ConfigError, match=r"mission\.collision_horizon_s = 12 needs") as caught:
        catalog.find("crossing", [setting])
    assert said in str(caught.value)
