"""The gradient: the next hop towards a head, learned from neighbors' hellos, by hand."""

from fanet_mw.node.neighbors import Neighbor, Neighbors
from fanet_mw.routing.clustered.forwarding.gradient import UNREACHABLE, Gradient
from fanet_mw.units import NodeId, S
from fanet_mw.wire.hello.beacon import Beacon

ME, HEAD, OTHER = NodeId(1), NodeId(10), NodeId(20)


def gradient() -> Gradient:
    found = Gradient(node=ME, neighbors=Neighbors(lifetime_ns=4 * S), hello_ns=S)
    found.join(HEAD, now_ns=0)
    return found


def hello(node: int, hops: int, *, head: int = HEAD, seq: int = 5) -> Neighbor:
    return Neighbor(NodeId(node), 0, -60.0, Beacon(node, head, seq, 0, 1, 0, 1, hops))


def parent(found: Gradient, now_ns: int = 0) -> int | None:
    route = found.route(now_ns=now_ns)
    return route.parent if route else None


def test_fewer_hops_win_at_the_same_sequence() -> None:
    found = gradient()
    found.on_hello(hello(2, 3), now_ns=0)
    found.on_hello(hello(3, 1), now_ns=0)
    found.on_hello(hello(4, 2), now_ns=0)
    assert parent(found) == 3


def test_an_older_sequence_never_wins_however_short() -> None:
    found = gradient()
    found.on_hello(hello(2, 3, seq=5), now_ns=0)
    found.on_hello(hello(3, 0, seq=4), now_ns=0)
    assert parent(found) == 2


def test_the_own_head_is_preferred_and_another_is_better_than_none() -> None:
    found = gradient()
    found.on_hello(hello(2, 0, head=OTHER), now_ns=0)
    assert parent(found) == 2
    found.on_hello(hello(3, 4), now_ns=0)
    assert parent(found) == 3
    found.on_hello(hello(2, 0, head=OTHER, seq=99), now_ns=0)
    assert parent(found) == 3


def test_a_route_dies_when_its_head_is_silent_for_four_hellos() -> None:
    found = gradient()
    found.on_hello(hello(2, 1), now_ns=0)
    found.on_hello(hello(2, 1), now_ns=3 * S)
    assert parent(found, 4 * S) == 2
    assert parent(found, 4 * S + 1) is None, "hellos that bring no newer sequence keep nothing alive"


def test_neighbors_that_still_talk_of_a_dead_head_do_not_keep_each_other_s_routes_alive() -> None:
    found = gradient()
    found.on_hello(hello(2, 1), now_ns=0)
    for second in range(1, 12):
        found.on_hello(hello(3, 2), now_ns=second * S)
    assert parent(found, 5 * S) is None
    found.on_hello(hello(4, 3, head=OTHER), now_ns=6 * S)
    assert parent(found, 6 * S) == 4, "another head is better than none"


def test_a_head_that_started_again_is_believed_once_the_old_news_is_forgotten() -> None:
    found = gradient()
    found.on_hello(hello(2, 1, seq=500), now_ns=0)
    found.on_hello(hello(2, 1, seq=1), now_ns=10 * S)
    assert parent(found, 10 * S) is None
    found.on_hello(hello(2, 1, seq=2), now_ns=17 * S)
    assert parent(found, 17 * S) == 2


def test_a_parent_that_loses_its_way_is_given_up() -> None:
    found = gradient()
    found.on_hello(hello(2, 1), now_ns=0)
    found.on_hello(hello(2, UNREACHABLE), now_ns=S)
    assert parent(found, S) is None


def test_a_failed_link_is_given_up_at_once() -> None:
    found = gradient()
    found.on_hello(hello(2, 1), now_ns=0)
    found.lose(NodeId(2))
    assert parent(found) is None


def test_a_head_is_its_own_way_and_counts_its_sequence() -> None:
    found = gradient()
    found.join(ME, now_ns=0)
    found.on_hello(hello(2, 1), now_ns=0)
    found.advance(S)
    route = found.route(now_ns=S)
    assert route is not None
    assert (route.head, route.hops, route.head_seq) == (ME, 0, 1)


def test_a_way_over_a_neighbor_is_one_hop_longer_than_its_own() -> None:
    for hops in (0, 3):
        found = gradient()
        found.on_hello(hello(2, hops), now_ns=0)
        route = found.route(now_ns=0)
        assert route is not None
        assert route.hops == hops + 1


def test_a_longer_way_must_be_newer_by_more_than_the_next_hello() -> None:
    """The parent says the next number with its own next hello: to turn for that would make routes swing."""
    found = gradient()
    found.on_hello(hello(2, 1, seq=5), now_ns=0)
    found.on_hello(hello(3, 2, seq=6), now_ns=0)
    assert parent(found) == 2
    found.on_hello(hello(3, 2, seq=7), now_ns=0)
    assert parent(found) == 3
