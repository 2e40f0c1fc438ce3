"""Which orders a UAV obeys, and whom it tells them on."""

from itertools import permutations

import pytest

from agents.mission.orders import KnownOrders
from fanet_mw.orders import Order, OrderKind, is_told, wrong
from fanet_mw.units import NodeId, S
from fanet_mw.wire.search_messages import ToldOrder, told_in


def told(serial: int, kind: OrderKind, node: int = 0, radius_m: float = 0.0) -> ToldOrder:
    return ToldOrder(serial * 1_000_000, 9, serial, Order(kind, node, 10.0, 20.0, radius_m))


GIVEN = [
    told(1, OrderKind.STAY, 3), told(2, OrderKind.SEARCH, 3, 50.0), told(3, OrderKind.RECALL, 4),
    told(4, OrderKind.NO_FLY, 0, 30.0),
]  # fmt: skip


@pytest.mark.parametrize("order", list(permutations(range(4))))
def test_the_order_with_the_greatest_number_holds_in_whatever_order_they_arrive(order: tuple[int, ...]) -> None:
    known = KnownOrders(NodeId(3))
    assert all(known.learn(GIVEN[one], 0) for one in order)
    assert known.errand == GIVEN[1].order
    assert [known.is_to_obey(one) for one in GIVEN] == [False, True, False, True]


def test_the_end_is_for_good_and_a_release_ends_an_errand() -> None:
    known = KnownOrders(NodeId(3))
    known.learn(told(1, OrderKind.STAY, 3), 0)
    known.learn(release := told(2, OrderKind.RELEASE), 0)
    assert known.is_to_obey(release)
    assert known.errand is None
    known.learn(end := told(3, OrderKind.END), 0)
    known.learn(again := told(4, OrderKind.STAY, 3), 0)
    assert known.is_to_obey(end)
    assert not known.is_to_obey(again)


@pytest.mark.parametrize("kind", [OrderKind.RELEASE, OrderKind.STAY, OrderKind.RECALL])
def test_the_end_is_for_good_too_for_who_learns_of_a_later_order_first(kind: OrderKind) -> None:
    known = KnownOrders(NodeId(3))
    known.learn(later := told(4, kind), 0)
    assert known.is_to_obey(later)
    known.learn(end := told(3, OrderKind.END), S)
    assert known.is_to_obey(end)
    assert not known.is_to_obey(later)
    assert known.errand is None


def test_an_order_is_learned_once_and_told_on_for_a_while() -> None:
    known = KnownOrders(NodeId(3))
    assert known.learn(GIVEN[2], S)
    assert not known.learn(GIVEN[2], 2 * S)
    assert told_in(bytes(36) + known.hello_frames(12 * S)) == (GIVEN[2],)
    assert known.hello_frames(14 * S) == b""


@pytest.mark.parametrize(
    ("order", "why"),
    [
        (Order(OrderKind.RECALL, 6), "node = 6 must be in [1, 5]"),
        (Order(OrderKind.END, 2), "end is for all UAVs, not for node 2"),
        (Order(OrderKind.SEARCH, 2, 0.0, 0.0, 0.0), "radius_m = 0 must be > 0"),
        (Order(OrderKind.STAY, 2, float("nan"), 0.0), "[nan, 0] and radius 0 m must be within 1e+06"),
    ],
)
def test_an_impossible_order_is_refused_with_its_value_and_bound(order: Order, why: str) -> None:
    assert wrong(order, uavs=5) == why


def test_only_the_post_may_leave_open_whom_an_order_with_a_place_is_for() -> None:
    assert not is_told(Order(OrderKind.STAY))
    assert is_told(Order(OrderKind.RECALL))
    assert is_told(Order(OrderKind.STAY, 4))


def test_a_thousand_orders_are_remembered_and_no_forged_one_more() -> None:
    known = KnownOrders(NodeId(3))
    learned = [known.learn(told(serial % 60_000, OrderKind.NO_FLY, 0, float(serial)), 0) for serial in range(1, 1003)]
    assert learned == [True] * 1000 + [False] * 2
    assert not known.learn(told(1, OrderKind.NO_FLY, 0, 1.0), 0), "and none is new twice"
