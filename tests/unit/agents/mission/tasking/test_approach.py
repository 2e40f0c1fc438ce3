"""The approach to a survivor, around an estimate of the place."""

import math
from itertools import pairwise

from search_board import FOLLOWER, UP_M, Board

from agents.mission.finding.looked_at import LookedAt
from agents.mission.finding.phone_localization import Estimate
from fanet_mw.motion import Motion
from fanet_mw.units import STILL, Enu, S
from fanet_mw.wire.search_messages import Bid
from fanet_mw.wire.survivors import Survivor


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


def test_a_responder_leaves_places_to_another_responder_and_not_to_a_passer_by() -> None:
    here, later_ns = Enu(0, 0, UP_M), 5 * S

    def looks_at(other: Enu | None, bids: list[Bid]) -> tuple[float, float]:
        looked_at = LookedAt((40.0, 40.0), height_m=UP_M)
        looked_at.note(here, 0)
        board = Board(FOLLOWER, here, plan=None, looked_at=looked_at)
        if other is not None:
            board.neighbors.on_hello(3, Motion(other, STILL, later_ns))
        board.survivors.take_report(Survivor(0, 1, FOLLOWER, here, -88.0), now_ns=0)
        board.tasks.merge(bids, now_ns=later_ns)
        board.tasks.bid(later_ns)
        board.tasks.choose(later_ns)
        place = board.survivors.by_id[1].place()
        assert board.tasks.survivor == 1
        assert place is not None
        return board.approach.next_point(1, place, later_ns, responding=True)

    alone = looks_at(None, [])
    beside = Enu(alone[0] / 2, alone[1] / 2, UP_M)
    assert looks_at(beside, []) == alone
    shared = looks_at(beside, [Bid(1, 3, 10, 1, 0)])
    assert math.dist(shared, alone) > math.hypot(*alone)


def test_a_responder_that_a_building_or_the_swarm_keeps_from_the_place_looks_around_where_it_is() -> None:
    board = Board(FOLLOWER, Enu(0, -80, UP_M))
    board.hear(1, Enu(0, 0, 0), range(1, 5), now_ns=0)
    place = board.survivors.by_id[1].place()
    assert place is not None
    straight = place.east_m, place.north_m
    assert [board.approach.next_point(1, place, t * S, responding=True) for t in range(3)] == [straight] * 3
    assert board.approach.next_point(1, place, 3 * S, responding=True) != straight
    assert not board.out.records, "it has not arrived"


def test_a_passer_by_that_stands_goes_on_to_the_place_and_so_does_a_responder_that_gets_on() -> None:
    passing, flying = Board(FOLLOWER, Enu(0, -80, UP_M)), Board(FOLLOWER, Enu(0, -80, UP_M))
    for board in (passing, flying):
        board.hear(1, Enu(0, 0, 0), range(1, 5), now_ns=0)
    place = passing.survivors.by_id[1].place()
    assert place is not None
    for second in range(5):
        flying.own_motion.fix(Enu(0, -80 + 8 * second, UP_M), STILL, now_ns=second * S)
        for board, responding in ((passing, False), (flying, True)):
            point = board.approach.next_point(1, place, second * S, responding=responding)
            assert point == (place.east_m, place.north_m)
