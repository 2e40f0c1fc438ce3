"""Tasks: a UAV bids for survivors that were reported, wins, and gives up."""

from search_board import FOLLOWER, TAKEN_UP_NS, Board, lane_of

from fanet_mw.trace import Approaching, Arrived
from fanet_mw.units import Enu, S
from fanet_mw.wire.search import Bid


def test_a_follower_bids_for_a_reported_survivor_near_its_line_wins_and_says_so() -> None:
    now_ns = TAKEN_UP_NS + 20 * S
    at = lane_of(FOLLOWER, now_ns)
    board = Board(FOLLOWER, at)
    board.hear(1, Enu(at.east + 60, at.north, 0), range(1, 5), now_ns=now_ns)
    board.tasks.bid(now_ns)
    board.tasks.choose(now_ns)
    assert board.tasks.survivor == 1
    assert [type(record) for record in board.out.records] == [Approaching]
    board.tasks.close(1, now_ns=now_ns)
    assert board.tasks.survivor is None


def test_better_bids_take_a_task_away() -> None:
    now_ns = TAKEN_UP_NS + 20 * S
    at = lane_of(FOLLOWER, now_ns)
    board = Board(FOLLOWER, at)
    board.hear(1, Enu(at.east + 60, at.north, 0), range(1, 5), now_ns=now_ns)
    board.tasks.bid(now_ns)
    board.tasks.choose(now_ns)
    board.tasks.merge([Bid(1, bidder, 1, 1) for bidder in (30, 31)], now_ns=now_ns)
    board.tasks.choose(now_ns)
    assert board.tasks.survivor == 1, "three are wanted"
    board.tasks.merge([Bid(1, 32, 1, 1)], now_ns=now_ns)
    board.tasks.choose(now_ns)
    assert board.tasks.survivor is None


def test_one_who_has_not_reported_is_sent_where_reporters_are_too_few_and_one_who_has_is_not() -> None:
    now_ns = TAKEN_UP_NS + 20 * S
    at = lane_of(FOLLOWER, now_ns)
    for reporters, bids in ((range(1, 2), 1), (range(FOLLOWER, FOLLOWER + 1), 0)):
        board = Board(FOLLOWER, at)
        board.hear(1, Enu(at.east + 60, at.north + (80 if at.north > 0 else -80), 0), reporters, now_ns=now_ns)
        board.tasks.bid(now_ns + 3 * S)
        assert board.tasks.bids_to_tell(now_ns=now_ns) == [], "somebody may still come by"
        board.tasks.bid(now_ns + 5 * S)
        assert len(board.tasks.bids_to_tell(now_ns=now_ns + 5 * S)) == bids


def test_a_responder_that_finds_nobody_takes_its_bid_back_and_does_not_bid_again_at_once() -> None:
    now_ns = TAKEN_UP_NS + 20 * S
    at = lane_of(FOLLOWER, now_ns)
    board = Board(FOLLOWER, at)
    board.hear(1, Enu(at.east, at.north, 0), range(1, 5), now_ns=now_ns)
    board.tasks.bid(now_ns)
    board.tasks.choose(now_ns)
    board.goal.at(board.tasks.survivor, now_ns)
    assert [type(record) for record in board.out.records] == [Approaching, Arrived]
    later_ns = now_ns + 46 * S
    board.tasks.choose(later_ns)
    board.tasks.bid(later_ns)
    assert board.tasks.survivor is None
    assert [bid.eta_ds for bid in board.tasks.bids_to_tell(now_ns=later_ns)] == [0xFFFF]
    board.tasks.reopen(1)
    assert board.approach.arrived_ns == {}, "what it came to was not the place"
