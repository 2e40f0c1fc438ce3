"""A swarm that stands at a base takes off straight up before it flies to its places: whole runs in virtual time."""

import math
from collections import defaultdict
from collections.abc import Callable

import pytest
from kit import slow

from fanet_mw.scenario import Scenario
from fanet_mw.trace import Collided, FlightModeChanged, MissionModeChanged, Posed
from fanet_mw.units import S
from sim.run.virtual import simulate

KEYS = {
    "nodes.count": 4, "nodes.on_ground": True, "nodes.altitude_m": 40, "duration_s": 60, "warmup_s": 1, "drain_s": 1,
    "mission.survivors": 1, "mission.search": "spiral", "mobility.model": "onboard", "world.area_m": 600,
    "world.base_m": [-350, 0], "world.crash": "falls", "radio.range_m": 250, "traffic.arrivals": "none",
    "nodes.telemetry_hz": 0,
}  # fmt: skip


@pytest.mark.parametrize(("spacing_m", "terrain_m"), [(6, 0), *slow((15, 0), (15, 30))])
def test_who_stands_at_the_base_climbs_straight_up_and_only_then_flies_to_its_place(
    make_scenario: Callable[..., Scenario], spacing_m: float, terrain_m: float
) -> None:
    """All leave pads 15 m apart at once, and nobody flies off while others still climb, because the plan leaves time
    for the climb. Pads that are only 6 m apart are left one after the other.
    """
    lasts_s = KEYS["duration_s"] if spacing_m >= 15 else 72  # the plan waits for those who take off in turns
    pads = {"nodes.spacing_m": spacing_m, "world.terrain_m": terrain_m, "duration_s": lasts_s}
    outcome = simulate(make_scenario(**{**KEYS, **pads}))
    posed: dict[int, list[Posed]] = defaultdict(list)
    modes: dict[int, list[FlightModeChanged]] = defaultdict(list)
    wanted: dict[int, list[str]] = defaultdict(list)
    for record in outcome.records:
        if isinstance(record, Posed):
            posed[record.node].append(record)
        elif isinstance(record, FlightModeChanged):
            modes[record.node].append(record)
        elif isinstance(record, MissionModeChanged):
            wanted[record.node].append(record.mode)
    assert not [record for record in outcome.records if isinstance(record, Collided)]
    assert outcome.reports["world"]["crashed"] == 0
    left_s = []
    for node in range(1, 5):
        took_off, flew = modes[node][:2]
        assert took_off.mode == "takeoff"
        assert flew.mode in ("goto", "velocity"), "it flies, and hovers if the plan has not begun"
        assert wanted[node][:2] == ["takeoff", "deploy"]
        pad = posed[node][0]
        for at in posed[node]:
            away_m = _away_m(at, pad)
            if at.t_ns < took_off.t_ns:
                assert at.up_m == pytest.approx(pad.up_m, abs=0.3), "it stands on its pad"
            if at.t_ns <= flew.t_ns:
                assert away_m < 2.0, (node, at)
            if away_m > 20:
                assert at.up_m > pad.up_m + 0.8 * 40 - terrain_m, (node, at)
        assert _away_m(posed[node][-1], pad) > 40, "and then it leaves"
        left_s.append(next(at.t_ns / S for at in posed[node] if _away_m(at, pad) > 5.0))
    took_off_s = [modes[node][0].t_ns / S for node in range(1, 5)]
    climbed_s = [modes[node][1].t_ns / S for node in range(1, 5)]
    at_once = spacing_m >= 15
    assert (max(took_off_s) - min(took_off_s) < 2) == at_once
    assert (min(left_s) > max(climbed_s)) == at_once


def _away_m(at: Posed, pad: Posed) -> float:
    return math.hypot(at.east_m - pad.east_m, at.north_m - pad.north_m)
