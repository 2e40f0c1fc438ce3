"""The velocity of a UAV in a search: clear of walls and of others, in reach of those beside it."""

import pytest
from search_board import COUNT, FOLLOWER, LINE, OPEN, REACH_M, TAKEN_UP_NS, UP_M, Board, lane_of

from agents.mission.flight.velocity_choice import ClearOfOthers, InReach, VelocityChoice
from agents.mission.navigation.half_planes import HalfPlane
from agents.mission.navigation.navigation import Navigation
from agents.mission.navigation.neighbor_motions import NeighborMotions
from fanet_mw.motion import Motion
from fanet_mw.units import Enu, S


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

    steering = VelocityChoice(Navigation(Enu(0, 0, UP_M), OPEN), OPEN, most_m_s=10, hard=[Wall(2)], soft=[Tether()])
    flown = steering.velocity(Enu(1000, 0, UP_M), Enu(0, 0, 0), 0)
    assert flown.east == pytest.approx(2)


def test_neighbors_are_avoided_while_they_are_heard_at_their_level() -> None:
    navigation, neighbors = Navigation(Enu(0, 0, UP_M), OPEN), NeighborMotions()
    navigation.fix(Enu(0, 0, UP_M), Enu(5, 0, 0), now_ns=0)
    clear = ClearOfOthers(navigation, neighbors, OPEN)
    neighbors.on_hello(2, Motion(Enu(60, 0, UP_M), Enu(-5, 0, 0), 0))
    neighbors.on_hello(3, Motion(Enu(60, 0, UP_M + 12), Enu(0, 0, 0), 0))
    assert len(clear.planes(S)) == 1
    assert clear.planes(7 * S) == []


def test_a_uav_of_a_line_is_tied_to_those_beside_it_and_a_follower_to_the_nearest_of_its_line() -> None:
    now_ns = TAKEN_UP_NS + 20 * S
    for node, ties in ((LINE, 2), (FOLLOWER, 1)):
        board = Board(node, lane_of(node, now_ns))
        for other in range(1, COUNT + 1):
            if other != node:
                board.neighbors.on_hello(other, Motion(lane_of(other, now_ns), Enu(0, 0, 0), now_ns))
        tied = InReach(board.navigation, board.neighbors, board.place, reach_m=REACH_M)
        assert len(tied.planes(now_ns)) == ties
