"""How UAVs that foresee a collision warn and avoid each other is kept: two releases may meet in the air."""

import math
from collections.abc import Iterator
from typing import Any

import pytest
from kept_values import kept
from kit import MakeScenario

from agents.applications.collision_avoidance import ConflictMonitor
from fanet_mw.mavlink import Collision
from fanet_mw.motion import Motion
from fanet_mw.units import MS, Enu, NodeId


@pytest.mark.parametrize(("count", "aside_m"), [(2, 0), (2, 9), (3, 4), (5, 0)])
@pytest.mark.parametrize("vertical", [0.0, 2.0])
def test_encounters_are_what_they_were_before(
    make_scenario: MakeScenario, count: int, aside_m: float, vertical: float
) -> None:
    keys = {"nodes.count": 9, "mission.collision_horizon_s": 10, "mission.collision_distance_m": 15}
    scenario = make_scenario(**keys, **{"sensors.gps_vertical": vertical})
    monitors = {NodeId(n): ConflictMonitor(scenario, NodeId(n)) for n in range(1, count + 1)}
    turns = {node: 2 * math.pi * rank / count + 0.1 * rank for rank, node in enumerate(monitors)}
    at = {n: Enu(-140 * math.sin(a) + aside_m, -140 * math.cos(a), 50.0) for n, a in turns.items()}
    courses = {n: Enu(9 * math.sin(a), 9 * math.cos(a), 0.0) for n, a in turns.items()}

    def values() -> Iterator[Any]:
        for step in range(200):
            now_ns, motions = step * 200 * MS, dict[NodeId, Motion]()
            for node, monitor in monitors.items():
                velocity = courses[node]
                if monitor.avoids and monitor.course is not None:
                    off = monitor.course.position.minus(at[node])
                    share = monitor.course.speed_m_s / max(1.0, off.norm())
                    velocity = Enu(share * off.east, share * off.north, share * off.up)
                at[node] = at[node].minus(Enu(-0.2 * velocity.east, -0.2 * velocity.north, -0.2 * velocity.up))
                motions[node] = Motion(at[node], velocity, now_ns)
            for node, monitor in monitors.items():
                for other, motion in motions.items():
                    if other != node and (step + other) % 5 == 0:
                        monitor.on_hello(other, motion, now_ns=now_ns)
                monitor.on_fix(motions[node])
            for node, monitor in monitors.items():
                for other, approach in monitor.warnings if step % 3 else ():  # each third one is lost
                    apart = abs(approach.apart.up), approach.apart.horizontal()
                    told = Collision(other, approach.closest_s, *apart)
                    monitors[other].on_warning(node, told, motions[other], born_ns=now_ns - 40 * MS, now_ns=now_ns)
                yield node, at[node], monitor.course, monitor.warnings, monitor.records
                monitor.warnings, monitor.records = [], []

    kept(f"encounters, {count}, {aside_m} m aside, {vertical}", values())
