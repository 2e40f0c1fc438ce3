"""The velocity of a UAV in a search, under hard and soft constraints."""

import pytest
from search_board import OPEN, UP_M

from agents.mission.flight.velocity_choice import VelocityChoice
from agents.mission.navigation.half_planes import HalfPlane
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.onboard_map import NO_MAP
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw.units import Enu


class Wall:
    """Nobody flies east faster than this."""

    def __init__(self, most_m_s: float) -> None:
        self._most_m_s = most_m_s

    def planes(self, now_ns: int) -> list[HalfPlane]:
        return [HalfPlane(-1.0, 0.0, -self._most_m_s)]


def test_a_velocity_obeys_hard_constraints_and_gives_soft_ones_up() -> None:
    away = HalfPlane(1.0, 0.0, 5.0)

    class Tether:
        def planes(self, now_ns: int) -> list[HalfPlane]:
            return [away]

    steering = VelocityChoice(OwnMotion(Enu(0, 0, UP_M), OPEN), OPEN, most_m_s=10, hard=[Wall(2)], soft=[Tether()])
    flown = steering.velocity(Enu(1000, 0, UP_M), Enu(0, 0, 0), 0)
    assert flown.east == pytest.approx(2)


def test_a_uav_closes_in_on_its_place_by_the_distance_and_hastily_sooner() -> None:
    steering = VelocityChoice(OwnMotion(Enu(0, 0, UP_M), OPEN), OPEN, most_m_s=10, hard=[], soft=[])
    for goal, feed, hastily, wanted in (
        (Enu(10, -5, UP_M), Enu(0, 0, 0), False, (4, -2)),
        (Enu(10, -5, UP_M), Enu(0, 0, 0), True, (6, -3)),
        (Enu(10, -5, UP_M), Enu(-1, 3, 0), False, (3, 1)),
        (Enu(-300, 400, UP_M), Enu(0, 0, 0), False, (-6, 8)),
    ):
        flown = steering.velocity(goal, feed, 0, hastily=hastily)
        assert (flown.east, flown.north) == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("corner_m", "goal_m", "speed_m_s"),
    [(50.0, 400.0, 10.0), (50.0, 2.0, 5.0), (50.0, 20.0, 8.0), (3.0, 400.0, 3.0), (1.0, 400.0, 1.0), (0.2, 400.0, 1.0)],
)
def test_around_a_corner_a_uav_flies_as_fast_as_it_can_turn_there(
    corner_m: float, goal_m: float, speed_m_s: float
) -> None:
    class Corner(KnownObstacles):
        def way_to(self, here: Enu, goal: Enu, feed: Enu, *, now_ns: int) -> Enu:
            return Enu(-0.6 * corner_m, 0.8 * corner_m, UP_M)

    steering = VelocityChoice(OwnMotion(Enu(0, 0, UP_M), OPEN), Corner(NO_MAP), most_m_s=10, hard=[], soft=[])
    flown = steering.velocity(Enu(goal_m, 0, UP_M), Enu(0, 0, 0), 0)
    assert (flown.east, flown.north) == pytest.approx((-0.6 * speed_m_s, 0.8 * speed_m_s))
