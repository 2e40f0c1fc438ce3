"""How a UAV gets around what it knows of is the same in every release: others reckon with it."""

import math
import random
from collections.abc import Iterator
from typing import Any

import pytest
from kept_values import kept
from test_known_obstacles import STILL, TOWER, flown

from agents.mission.flight.reciprocal_avoidance import ReciprocalAvoidance, avoidance_plane
from agents.mission.navigation.half_planes import HalfPlane, nearest
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.onboard_map import NO_MAP, Building, OnboardMap
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw.bus.messages import Echo
from fanet_mw.motion import Motion
from fanet_mw.units import MS, Enu, S

START, GOAL = Enu(-100, 3, 60), Enu(100, -3, 60)


def town(seed: int) -> tuple[Building, ...]:
    drawn = random.Random(seed)
    return tuple(
        Building(drawn.uniform(-70, 70), drawn.uniform(-40, 40), *(drawn.uniform(8, 40) for _ in "wd"),
                 drawn.uniform(40, 90), yaw_rad=drawn.uniform(0, 1.5)) for _ in range(5)
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(2))
def test_ways_around_houses_are_what_they_were_before(seed: int) -> None:
    houses = town(seed)
    known = KnownObstacles(OnboardMap(houses[:3]), no_fly_m=((20.0, -60.0, 15.0),))
    places = flown(known, START, GOAL, seconds=30, seen=houses)
    levels = [(known.roof_m(at), known.ground_m(at), known.least_up_m(at, Enu(5, 1, 0))) for at in places[::5]]
    rises = [known.rises_m(at, Enu(4, -2, 0), (1.0, 3.0, 6.0)) for at in places[::9]]
    known.close(0.0, 80.0, 25.0)
    ways = [
        known.way_to(Enu(9.0 * n, 110, 50), Enu(0, 40 - 9.0 * n, 50), Enu(3, 0, 0), now_ns=30 * S) for n in range(9)
    ]
    kept(f"ways, {seed}", [places, levels, rises, known.hides, known.has_hills, ways])


def test_what_a_radar_shows_is_what_it_was_before() -> None:
    known, drawn = KnownObstacles(OnboardMap((TOWER,))), random.Random(2)

    def values() -> Iterator[Any]:
        for step in range(60):
            at, velocity = Enu(-80 + 2.0 * step, 40, 60), Enu(10, 0, 0)
            echoes = [
                Echo(drawn.uniform(1, 120), drawn.uniform(-math.pi, math.pi), drawn.uniform(-0.3, 0.3),
                     drawn.uniform(-20, 20), drawn.uniform(5, 40)) for _ in range(8)
            ]  # fmt: skip
            echoes += [Echo(50 - 0.6 * step, 0.5, 0.0, 9.0, 20.0), Echo(70.0, 1.0 + step / 90, 0.02, 5.4, 20.0)]
            known.radar(echoes, at=at, velocity=velocity, neighbors=[Enu(-40, 40, 60)], now_ns=step * 500 * MS)
            yield known.movers(step * 500 * MS), known.planes(at, step * 500 * MS)
            yield known.way_to(at, Enu(100, 40, 60), STILL, now_ns=step * 500 * MS)

    kept("radar", values())


def test_velocities_that_keep_clear_are_what_they_were_before() -> None:
    def values() -> Iterator[Any]:
        for seed in range(60):
            drawn = random.Random(seed)

            def velocity(drawn: random.Random = drawn) -> Enu:
                return Enu(drawn.uniform(-9, 9), drawn.uniform(-9, 9), 0.0)

            planes = [
                HalfPlane(math.cos(angle), math.sin(angle), drawn.uniform(-6, 6))
                for angle in (drawn.uniform(0, 7) for _ in range(seed % 7))
            ]
            yield nearest(velocity()[:2], planes, limit=8, hard=len(planes) // 2)
            own, neighbors = OwnMotion(Enu(0, 0, 60), KnownObstacles(NO_MAP)), NeighborMotions()
            own.fix(Enu(0, 0, 60), velocity(), now_ns=0)
            for node in range(2, 7):
                there = Enu(drawn.uniform(-60, 60), drawn.uniform(-60, 60), 60 + drawn.uniform(-12, 12))
                neighbors.on_hello(node, Motion(there, velocity(), 0))
                yield avoidance_plane(there, velocity()[:2], velocity()[:2], clearance_m=10, horizon_s=6, share=0.5)
            yield ReciprocalAvoidance(own, neighbors, KnownObstacles(NO_MAP)).planes(S // 5)

    kept("keeping clear", values())
