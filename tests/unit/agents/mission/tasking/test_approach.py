"""The approach to a survivor, around an estimate of the place."""

import math
from itertools import pairwise

from search_board import FOLLOWER, UP_M, Board

from agents.mission.finding.phone_localization import Estimate
from fanet_mw.units import Enu, S


def test_around_an_estimate_the_spiral_widens_until_somebody_is_seen() -> None:
    board = Board(FOLLOWER, Enu(0, 0, UP_M))
    board.hear(1, Enu(0, 0, 0), range(1, 5), now_ns=0)
    place = board.survivors.by_id[1].place()
    assert place is not None

    def radius_m(second: int) -> float:
        east, north = board.approach.next_point(1, place, second * S, responding=True)
        return math.hypot(east - place.east_m, north - place.north_m)

    assert (round(radius_m(0)), round(radius_m(20)), round(radius_m(40))) == (14, 44, 74)
    board.survivors.by_id[1].filter.on_sighting(Estimate(0, 0, 4, 0, 4))
    assert round(math.hypot(*board.approach.next_point(1, Estimate(0, 0, 4, 0, 4), 41 * S, responding=True))) == 40


def test_a_uav_can_keep_up_with_the_spiral_that_it_is_to_fly() -> None:
    board = Board(FOLLOWER, Enu(0, 0, UP_M))
    board.hear(1, Enu(0, 0, 0), range(1, 5), now_ns=0)
    place = board.survivors.by_id[1].place()
    assert place is not None
    way = [board.approach.next_point(1, place, step * S // 10, responding=True) for step in range(451)]
    steps_m = [math.dist(before, after) for before, after in pairwise(way)]
    assert max(steps_m) <= 0.1 * 10.0, "its greatest speed is 10 m/s"
    around = [math.atan2(north - place.north_m, east - place.east_m) for east, north in way]
    turned = sum((after - before) % (2 * math.pi) for before, after in pairwise(around))
    assert turned > 2 * math.pi, "it has looked in every direction before it gives up"
