"""Two UAVs collide, fall, and their radios go: what the swarm makes of it."""

from typing import Any

import pytest

from fanet_mw.scenario import config
from fanet_mw.trace import Collided, Delivered, RadioFault, RoleChanged
from fanet_mw.units import S
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.virtual import simulate


def crossing(**world: Any) -> Outcome:
    """Five UAVs, all within range; 4 and 5 fly towards each other and meet in the middle after some 13 s."""
    tree = {
        "duration_s": 36, "warmup_s": 5, "drain_s": 3,
        "nodes": {
            "count": 5, "layout": "explicit", "telemetry_hz": 0,
            "positions_m": [[0, 0, 90], [150, 0, 40], [-180, 0, 60], [0, 100, 50], [0, -100, 50]],
        },
        "clusters": {"count": 1, "flooding_period_s": 1.0},
        "traffic": {"payload_bytes": 128, "interval_s": 1.0},
        "radio": {"range_m": 600},
        "mobility": {"model": "crossing", "speed_m_s": 8, "see_m": 0},
        "world": {"engine": "kinematic", "area_m": 1000, **world},
    }  # fmt: skip
    return simulate(config.build(tree))


@pytest.mark.parametrize("radio", ["dies", "survives"])
def test_a_crash_takes_two_nodes_out_of_the_swarm_if_their_radios_go(radio: str) -> None:
    outcome = crossing(crash="falls", crash_radio=radio)
    (hit,) = [r for r in outcome.records if isinstance(r, Collided)]
    assert (hit.node, hit.other) == (5, 4)
    assert 11 * S < hit.t_ns < 15 * S
    summary = finish(outcome, out=None)
    assert summary["mission"]["collisions"] == 1, "and nobody flies into the wrecks on the ground"
    assert outcome.reports["world"]["crashed"] == 2
    assert summary["frames"]["closes"]
    late = [r for r in outcome.records if isinstance(r, Delivered) and r.t_ns > hit.t_ns + 5 * S]
    heard_by, heard_of = {r.node for r in late}, {r.origin for r in late}
    everyone = {1, 2, 3, 4, 5}
    assert heard_by == heard_of == (everyone if radio == "survives" else {1, 2, 3})
    silent = {r.node for r in outcome.records if isinstance(r, RadioFault) and r.label.startswith("crash-")}
    assert silent == (set() if radio == "survives" else {4, 5})
    changed = {r.node for r in outcome.records if isinstance(r, RoleChanged) and r.t_ns > hit.t_ns}
    assert (changed >= {2, 3}) == (radio == "dies"), "node 5 was the head; who has lost it finds another"


def test_without_crashes_those_who_touch_fly_on() -> None:
    outcome = crossing()
    summary = finish(outcome, out=None)
    assert summary["mission"]["collisions"] >= 1
    assert outcome.reports["world"]["crashed"] == 0
    assert summary["pdr"] == 1.0
