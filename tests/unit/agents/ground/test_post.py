"""What the post on the ground tells the swarm, and what it knows of it."""

from typing import Any

from agents.ground.post import KnownUavs
from agents.mission.orders import KnownOrders
from agents.uav import Uav
from fanet_mw.bus.messages import TxRequest
from fanet_mw.node.reader import decoded
from fanet_mw.orders import Order, OrderKind
from fanet_mw.units import US, Enu, NodeId, S
from fanet_mw.wire.search_messages import ToldOrder, told_in
from fanet_mw.wire.search_plan import SearchStatus

KEYS = {
    "nodes.count": 3, "ground.at_m": (0.0, -150.0), "mission.survivors": 1, "mission.search": "lines",
    "mobility.model": "onboard", "traffic.arrivals": "none", "routing.protocol": "flooding",
    "routing.hello_interval_s": 0,
}  # fmt: skip


def test_each_order_is_told_three_times_5_s_apart_whatever_others_are_given_meanwhile(make_scenario: Any) -> None:
    orders = [{"at_s": at_s, "order": "recall", "node": node} for node, at_s in ((1, 1.0), (2, 2.5), (3, 7.0))]
    scenario = make_scenario(**KEYS, orders=orders)
    post = Uav(scenario, scenario.post, "u", position=Enu(0.0, -150.0, 0.0))
    post.start(0)
    told: dict[int, list[float]] = {1: [], 2: [], 3: []}
    while (wake_ns := post.next_wake_ns()) is not None and wake_ns < 30 * S:
        post.wake(wake_ns)
        for _, request in post.outbox:
            for order in decoded(request.frame, told_in) if isinstance(request, TxRequest) else ():
                if isinstance(order, ToldOrder):
                    told[order.serial].append(wake_ns / S)
        post.outbox.clear()
    assert told == {1: [1.0, 6.0, 11.0], 2: [2.5, 7.5, 12.5], 3: [7.0, 12.0, 17.0]}


def given_by(post: Uav, *, since_ns: int, until_ns: int) -> list[ToldOrder]:
    """The orders that a post tells while it runs, each once."""
    post.start(since_ns)
    told: dict[ToldOrder, None] = {}
    while (wake_ns := post.next_wake_ns()) is not None and wake_ns < until_ns:
        post.wake(max(wake_ns, since_ns))
        for _, request in post.outbox:
            told |= dict.fromkeys(
                order
                for order in (decoded(request.frame, told_in) if isinstance(request, TxRequest) else ())
                if isinstance(order, ToldOrder)
            )
        post.outbox.clear()
    return [*told]


def test_a_post_that_was_started_again_is_obeyed_and_what_was_planned_before_is_the_same_order(
    make_scenario: Any,
) -> None:
    orders = [{"at_s": at_s, "order": "recall", "node": node} for node, at_s in ((1, 1.0), (2, 2.5), (2, 400.0))]
    scenario = make_scenario(**KEYS, orders=orders, duration_s=600)

    def post() -> Uav:
        return Uav(scenario, scenario.post, "u", position=Enu(0.0, -150.0, 0.0))

    uav = KnownOrders(NodeId(1))
    before = given_by(post(), since_ns=0, until_ns=300 * S)
    assert [(told.serial, told.order.node) for told in before] == [(1, 1), (2, 2)]
    assert all(uav.learn(told, 3 * S) for told in before)
    again = post()
    again.start(300 * S)
    again.receive("", Order(OrderKind.STAY, 1, 5.0, 6.0), 300 * S)
    told = given_by(again, since_ns=300 * S, until_ns=500 * S)
    assert set(before) < set(told)
    assert [uav.learn(each, 301 * S) for each in told if each in before] == [False, False]
    assert all(uav.learn(each, 301 * S) for each in told if each not in before)
    assert uav.errand == Order(OrderKind.STAY, 1, 5.0, 6.0)


def test_the_nearest_is_by_what_each_said_last_and_who_flies_home_is_none(make_scenario: Any) -> None:
    known = KnownUavs(make_scenario(**KEYS))
    assert known.nearest(0.0, 0.0, now_ns=0) is None
    for node, t_us, east_m, charge in ((1, 5, 10, 90), (1, 3, 900, 90), (2, 4, 50, 80), (3, 4, 1, 0)):
        known.on_status(SearchStatus(t_us, Enu(east_m, 0.0, 50.0), node, 1, charge))
    assert known.nearest(0.0, 0.0, now_ns=S) == 1, "an older status that comes later moves nobody"
    known.on_status(SearchStatus(6, Enu(300.0, 0.0, 50.0), NodeId(1), 1, 90))
    assert known.nearest(0.0, 0.0, now_ns=S) == 2


def test_a_uav_that_fell_silent_long_ago_is_chosen_only_if_all_have(make_scenario: Any) -> None:
    known = KnownUavs(make_scenario(**KEYS))
    known.on_status(SearchStatus(0, Enu(10.0, 0.0, 50.0), NodeId(1), 1, 90))
    assert known.nearest(0.0, 0.0, now_ns=600 * S) == 1
    known.on_status(SearchStatus(580 * S // US, Enu(90.0, 0.0, 50.0), NodeId(2), 1, 90))
    assert known.nearest(0.0, 0.0, now_ns=600 * S) == 2
