"""Whom a building of the map hides, and how soon."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from agents.mission.navigation.lines_of_sight import LinesOfSight, hides
from agents.mission.navigation.onboard_map import Building, OnboardMap
from fanet_mw.motion import Motion
from fanet_mw.units import STILL, Enu, S

TOWER = Building(0.0, 0.0, 40.0, 20.0, 90.0)
HERE = Motion(Enu(-100.0, 0.0, 65.0), STILL, 7 * S)


def left_s(other: Motion, own: Motion = HERE, tower: Building = TOWER) -> float | None:
    ends_ns = LinesOfSight(OnboardMap((tower,))).ends_ns(own, [(3, other)])
    return (ends_ns[3] - own.at_ns) / S if ends_ns else None  # type: ignore[index]


@pytest.mark.parametrize(
    ("at", "velocity", "left"),
    [
        (Enu(100, 0, 65), STILL, 0),
        (Enu(100, 200, 65), STILL, None),  # passes beside it
        (Enu(-40, 0, 65), STILL, None),  # is on this side
        (Enu(100, 112, 65), Enu(0, -10, 0), 7),  # 8.7 s before the line meets the corner: it is taken to be 9 m nearer
        (Enu(100, 112, 65), Enu(0, 10, 0), None),
        (Enu(100, 0, 140), STILL, 2),  # over the edge of the roof by 5 m: somebody may sink
        (Enu(100, 0, 180), STILL, None),
    ],
)
def test_a_line_of_sight_ends_where_a_building_comes_between(at: Enu, velocity: Enu, left: float | None) -> None:
    assert left_s(Motion(at, velocity, HERE.at_ns)) == left
    assert left_s(HERE, own=Motion(at, velocity, HERE.at_ns)) == left, "the other one finds the same"


def test_a_neighbor_has_flown_on_since_its_last_hello() -> None:
    old = Motion(Enu(100, 112, 65), Enu(0, -10, 0), HERE.at_ns - 2 * S)
    assert left_s(old) == 5


def test_who_sinks_behind_a_roof_over_which_it_was_seen_is_foreseen_from_both_ends() -> None:
    high, sinking = (Motion(Enu(east, 0, 120), Enu(0, 0, up), HERE.at_ns) for east, up in ((-100.0, 0), (100.0, -5)))
    assert left_s(sinking, own=high) == 7
    assert left_s(high, own=sinking) == 7
    assert left_s(high._replace(position=Enu(100, 0, 120)), own=high) is None, "while nobody sinks"


place = st.builds(Enu, st.floats(-150, 150), st.floats(-150, 150), st.floats(30, 130))


@given(here=place, there=place, yaw_rad=st.floats(-4, 4), middle=st.tuples(st.floats(-50, 50), st.floats(-50, 50)))
@examples(300)
def test_a_building_hides_what_lies_behind_some_point_of_it(
    here: Enu, there: Enu, yaw_rad: float, middle: tuple[float, float]
) -> None:
    building = Building(*middle, 40.0, 20.0, 90.0, yaw_rad)
    inside = False
    for step in range(401):
        at = here.plus(there.minus(here), step / 400)
        inside |= at.up <= building.roof_m and building.outside(at.east, at.north)[0] <= 0
    if inside:
        assert hides(building, here, there, margin_m=1e-6)
    elif hides(building, here, there, margin_m=0.0):
        assert hides(building, here, there, margin_m=2.0), "only a corner between two of the points"
        nearest = min(
            max(building.outside(at.east, at.north)[0], at.up - building.roof_m)
            for at in (here.plus(there.minus(here), step / 400) for step in range(401))
        )
        assert nearest < math.dist(here, there) / 400
