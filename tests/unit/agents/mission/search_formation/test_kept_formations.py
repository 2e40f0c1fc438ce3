"""All UAVs of a search compute the same places, also where they fly another release: what they come to is kept."""

from collections.abc import Iterator
from typing import Any

import pytest
from kept_values import kept

from agents.mission.search_formation.pattern import Pattern, fastest, fitted, of_few
from agents.mission.search_formation.shapes.contract import Demands, ShapeName
from fanet_mw.units import Enu

BASES = ((0.0, -0.54), (0.6, 0.1), (0.54, -0.54))
LOST = ((3,), (0, 7), (7, 8, 20, 31, 36), tuple(range(1, 40, 2)))


def demands(area_m: float, base: tuple[float, float] = BASES[0], *, seen_m: float = 131) -> Demands:
    base_m = base[0] * area_m, base[1] * area_m
    return Demands(area_m=area_m, seen_m=seen_m, reach_m=250, height_m=65, speed_m_s=7.5, base_m=base_m)


def flown(pattern: Pattern) -> Iterator[Any]:
    """Where everybody is over some sweeps, how fast, and tied to whom."""
    yield pattern.dimensions, pattern.shape.sweep_s, pattern.shape.lane_m, pattern.shape.rows()
    teams = range(pattern.dimensions.teams)
    few = [place for place in range(0, pattern.places, 1 + pattern.places // 12) if place not in pattern.vacant]
    for share in (-0.1, 0.03, 0.4, 0.97, 1.004, 1.4, 2.7, 3.6):
        swept_s = share * pattern.shape.sweep_s
        yield [pattern.shape.apart_m(team, 40.0 * team, 333.0, swept_s) for team in teams]
        for place in few:
            yield pattern.at(place, swept_s), pattern.velocity(place, swept_s)
            yield pattern.tethers(place, swept_s), pattern.may_leave(place, swept_s)
    for place in few:
        yield pattern.kind(place), pattern.dimensions.team_of(place), pattern.has_beside(place, frozenset({7, 31}))
        yield pattern.gap_beside(place, frozenset({7, 8, 31})), pattern.hops_from({pattern.places // 3})


def formed(shape: ShapeName) -> Iterator[Pattern]:
    for area_m in (300, 1000, 2500):
        for count in (1, 2, 3, 5, 8, 13, 21, 34, 45, 73):
            for base in BASES if shape is ShapeName.FAN else BASES[:1]:
                for sectors in (1, 4, 6) if shape is ShapeName.SECTORS else (1,):
                    made = fitted(count, demands(area_m, base), shape=shape, sectors_wanted=sectors)
                    if made is not None:
                        yield made


@pytest.mark.parametrize("shape", ShapeName)
def test_places_are_what_they_were_before(shape: ShapeName) -> None:
    kept(f"formations, {shape.name}", (value for pattern in formed(shape) for value in flown(pattern)))


@pytest.mark.parametrize("shape", ShapeName)
def test_places_without_some_uavs_are_what_they_were_before(shape: ShapeName) -> None:
    whole = [
        fitted(count, demands(area_m), shape=shape, sectors_wanted=4) for count, area_m in ((45, 2500), (73, 2500))
    ]
    closed = [pattern.closed(frozenset(lost)) for pattern in whole if pattern for lost in LOST]
    spans = [pattern.spans(frozenset(lost)) for pattern in whole if pattern for lost in (*LOST, (15,), (29, 30))]
    kept(f"formations closed, {shape.name}", [spans, *(value for pattern in closed for value in flown(pattern))])


@pytest.mark.parametrize("shape", ShapeName)
def test_places_around_a_swarm_are_what_they_were_before(shape: ShapeName) -> None:
    begun: list[Pattern] = []
    for count, apart_m in ((45, 150), (45, 60), (60, 100), (13, 120)):
        swarm = [Enu(apart_m * (n % 7 - 3.2), apart_m * (n // 7 - 2.9), 0.0) for n in range(count)]
        made = fitted(count, demands(1800), shape=shape, sectors_wanted=4)
        begun += made.begun_around(swarm)[:3] if made else []
    kept(f"formations begun, {shape.name}", (value for pattern in begun for value in flown(pattern)))


def test_the_fastest_formation_is_what_it_was_before() -> None:
    cases = [(count, demands(area_m, seen_m=seen_m)) for count in range(1, 64, 6) for area_m in (200, 900, 1800)
             for seen_m in (60, 131)]  # fmt: skip
    made = [fastest(*case) for case in cases] + [
        of_few(*case, connected=connected) for case in cases for connected in (True, False)
    ]
    kept("formations, the fastest", [pattern and pattern.dimensions for pattern in made])
