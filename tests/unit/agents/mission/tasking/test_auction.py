"""The auction: nodes that have heard the same bids name the same winners."""

from hypothesis import given
from hypothesis import strategies as st

from agents.mission.tasking.auction import Auction
from fanet_mw.units import NodeId, S
from fanet_mw.wire.search_messages import WITHDRAWN, Bid

bids = st.lists(
    st.builds(Bid, st.just(1), st.integers(2, 9), st.integers(0, 500) | st.just(WITHDRAWN), st.integers(0, 4)),
    max_size=12, unique_by=lambda bid: (bid.bidder, bid.serial),
)  # fmt: skip


@given(bids, st.randoms(use_true_random=False))
def test_who_has_heard_the_same_bids_in_any_order_names_the_same_winners(heard: list[Bid], random: object) -> None:
    first, second = Auction(NodeId(1)), Auction(NodeId(1))
    first.merge(heard, now_ns=S)
    for bid in sorted(heard, key=lambda _: random.random()):  # type: ignore[attr-defined]
        second.merge([bid], now_ns=S)
    assert first.winners(1, count=3, now_ns=S) == second.winners(1, count=3, now_ns=S)


def test_exactly_as_many_win_as_the_task_needs_and_ties_go_to_the_lower_id() -> None:
    auction = Auction(NodeId(5))
    auction.merge([Bid(1, 9, 40, 1), Bid(1, 2, 40, 1), Bid(1, 3, 10, 1)], now_ns=0)
    auction.bid(1, eta_s=4.0, now_ns=0)
    assert auction.winners(1, count=3, now_ns=0) == [3, 2, 5]
    assert not auction.would_win(1, eta_s=9.0, count=2, now_ns=0)


def test_who_would_win_comes_sooner_than_the_last_winner_or_as_soon_with_a_lower_id() -> None:
    auction = Auction(NodeId(5))
    auction.merge([Bid(1, 2, 40, 1), Bid(1, 6, 90, 1), Bid(2, 4, 40, 1)], now_ns=0)
    assert auction.would_win(1, eta_s=7.0, count=2, now_ns=0), "later than the first, and sooner than the second"
    assert auction.would_win(1, eta_s=9.0, count=2, now_ns=0)
    assert not auction.would_win(2, eta_s=4.0, count=1, now_ns=0)


def test_what_is_told_are_the_nodes_own_bid_and_those_that_arrive_first() -> None:
    auction = Auction(NodeId(50))
    auction.merge([Bid(1, bidder, 900 - bidder, 1) for bidder in range(1, 21)], now_ns=0)
    auction.bid(1, eta_s=95.0, now_ns=0)
    assert [bid.bidder for bid in auction.bids_to_tell([1], now_ns=0)] == [50, *range(20, 9, -1)]


def test_a_bid_counts_for_fifteen_seconds_and_a_nodes_own_until_it_is_taken_back() -> None:
    auction = Auction(NodeId(5))
    auction.merge([Bid(1, 2, 10, 1, age_s=15), Bid(1, 3, 10, 1, age_s=16)], now_ns=100 * S)
    auction.bid(1, eta_s=9.0, now_ns=100 * S)
    assert auction.winners(1, count=3, now_ns=100 * S) == [2, 5]
    assert auction.winners(1, count=3, now_ns=200 * S) == [5]


def test_a_winner_that_falls_silent_makes_room_for_the_next() -> None:
    auction = Auction(NodeId(5))
    auction.merge([Bid(1, 2, 10, 1), Bid(1, 3, 20, 1)], now_ns=0)
    auction.merge([Bid(1, 3, 20, 1)], now_ns=12 * S)
    assert auction.winners(1, count=1, now_ns=12 * S) == [2]
    assert auction.winners(1, count=1, now_ns=20 * S) == [3]


def test_a_bidder_that_was_silent_and_starts_again_is_believed_though_it_numbers_its_bids_anew() -> None:
    auction = Auction(NodeId(5))
    auction.merge([Bid(1, 2, 50, 40)], now_ns=0)
    for now_s, wins in ((15, []), (16, [2])):
        auction.merge([Bid(1, 2, 50, 1)], now_ns=now_s * S)
        assert auction.winners(1, count=1, now_ns=(now_s + 1) * S) == wins, "one that was heard lately is a late copy"


def test_a_bid_of_a_dead_uav_grows_older_at_each_hop_and_is_forgotten_by_all() -> None:
    """Two neighbors tell each other of it every 0.7 s, in whole seconds of age."""
    first, second = Auction(NodeId(5)), Auction(NodeId(6))
    first.merge([Bid(1, 2, 10, 1)], now_ns=0)
    for step in range(1, 40):
        now_ns = step * 7 * S // 10
        second.merge(first.bids_to_tell([1], now_ns=now_ns), now_ns=now_ns)
        first.merge(second.bids_to_tell([1], now_ns=now_ns), now_ns=now_ns)
        if now_ns > 15 * S:
            assert first.winners(1, count=1, now_ns=now_ns) == second.winners(1, count=1, now_ns=now_ns) == []


def test_a_bid_that_is_taken_back_no_longer_wins() -> None:
    auction = Auction(NodeId(5))
    auction.bid(1, eta_s=1.0, now_ns=0)
    auction.withdraw(1, now_ns=0)
    assert auction.winners(1, count=1, now_ns=0) == []
    assert [bid.eta_ds for bid in auction.bids_to_tell([1], now_ns=0)] == [WITHDRAWN]


def test_a_bid_that_is_withdrawn_twice_is_withdrawn_once() -> None:
    auction = Auction(NodeId(5))
    auction.withdraw(1, now_ns=0)
    assert auction.bids_to_tell([1], now_ns=0) == []
    auction.bid(1, eta_s=1.0, now_ns=0)
    auction.withdraw(1, now_ns=S)
    (told,) = auction.bids_to_tell([1], now_ns=S)
    auction.withdraw(1, now_ns=2 * S)
    assert auction.bids_to_tell([1], now_ns=2 * S) == [told], "it has no newer serial number"


def test_after_the_last_serial_number_the_next_bid_is_still_newer() -> None:
    auction = Auction(NodeId(5))
    auction.merge([Bid(1, 2, 10, 0xFFFF)], now_ns=0)
    auction.merge([Bid(1, 2, 90, 0)], now_ns=S)
    auction.merge([Bid(1, 2, 10, 0xFFFF)], now_ns=S)
    auction.merge([Bid(1, 3, 40, 1)], now_ns=S)
    assert auction.winners(1, count=2, now_ns=S) == [3, 2]


def test_the_first_bid_of_a_node_that_has_restarted_is_newer_than_all_of_its_earlier_ones() -> None:
    for earlier in (0, 1, 20_000, 0x7FFF, 0x8000, 40_000, 0xFFFF):
        other, restarted = Auction(NodeId(6)), Auction(NodeId(5))
        other.merge([Bid(1, 5, 10, earlier)], now_ns=0)
        restarted.merge(other.bids_to_tell([1], now_ns=0), now_ns=0)
        restarted.bid(1, eta_s=30.0, now_ns=S)
        other.merge(restarted.bids_to_tell([1], now_ns=S), now_ns=S)
        assert [bid.eta_ds for bid in other.bids_to_tell([1], now_ns=S)] == [300]
