"""The velocity of a UAV in a search, under hard and soft constraints."""

import pytest
from search_board import OPEN, UP_M

from agents.mission.flight.velocity_choice import VelocityChoice
from agents.mission.navigation.half_planes import HalfPlane
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
