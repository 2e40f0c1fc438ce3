"""What the post on the ground tells the swarm, and what it knows of it."""

from typing import Any

from agents.ground.post import KnownUavs
from agents.mission.orders import KnownOrders
from agents.uav import Uav
from fanet_mw.bus.messages import TxRequest
from fanet_mw.node.reader import decoded
from fanet_mw.orders import Order, OrderKind
from fanet_mw.units import US, Enu, NodeId, S
from fanet_mw.wire.frame import HEADER_BYTES
from fanet_mw.wire.search_messages import ROLL_NS, Roll, ToldOrder, told_in
from fanet_mw.wire.search_plan import Search, SearchStatus

KEYS = {
    "nodes.count": 3, "ground.at_m": (0.0, -150.0), "mission.survivors": 1, "mission.search": "lines",
    "mobility.model": "onboard", "traffic.arrivals": "none", "routing.protocol": "flooding",
    "routing.hello_interval_s": 0,
}  # fmt: skip
POST = NodeId(4)


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
    known = KnownUavs(make_scenario(**KEYS), POST)
    assert known.nearest(0.0, 0.0, now_ns=0) is None
    for node, t_us, east_m, charge in ((1, 5, 10, 90), (1, 3, 900, 90), (2, 4, 50, 80), (3, 4, 1, 0)):
        known.on_status(SearchStatus(t_us, Enu(east_m, 0.0, 50.0), node, 1, charge))
    assert known.nearest(0.0, 0.0, now_ns=S) == 1, "an older status that comes later moves nobody"
    known.on_status(SearchStatus(6, Enu(300.0, 0.0, 50.0), NodeId(1), 1, 90))
    assert known.nearest(0.0, 0.0, now_ns=S) == 2


def test_a_uav_that_fell_silent_long_ago_is_chosen_only_if_all_have(make_scenario: Any) -> None:
    known = KnownUavs(make_scenario(**KEYS), POST)
    known.on_status(SearchStatus(0, Enu(10.0, 0.0, 50.0), NodeId(1), 1, 90))
    assert known.nearest(0.0, 0.0, now_ns=600 * S) == 1
    known.on_status(SearchStatus(580 * S // US, Enu(90.0, 0.0, 50.0), NodeId(2), 1, 90))
    assert known.nearest(0.0, 0.0, now_ns=600 * S) == 2


def status(node: int, at_s: float, east_m: float) -> SearchStatus:
    return SearchStatus(round(at_s * S) // US, Enu(east_m, 0.0, 50.0), NodeId(node), 1, 90)


def roll(at_s: int, *ages_s: int, lost: tuple[int, ...] = (), revision: int = 1) -> Roll:
    """Who was heard how long before; `lost`: places."""
    return Roll(at_s * S // ROLL_NS, 1, revision, tuple(age * S // ROLL_NS for age in ages_s), frozenset(lost))


def test_a_uav_that_the_swarm_calls_lost_is_given_no_order_until_it_is_heard_again(make_scenario: Any) -> None:
    known = KnownUavs(make_scenario(**KEYS), POST)
    known.on_plan(Search(1, 100.0, 10.0, 50.0, 50.0, 7.5, 10, 1, 1, (1, 2, 3, 0), 2, 0, 0))
    for node in (1, 2, 3):
        known.on_status(status(node, 10, 100.0 * node))
    known.on_roll(roll(16, 0, 0, 0, 0, lost=(0,), revision=2), now_ns=16 * S)
    assert known.nearest(0.0, 0.0, now_ns=16 * S) == 1, "the roll of another plan names other places"
    known.on_roll(roll(16, 5, 0, 0, 0, lost=(0,)), now_ns=16 * S)
    assert known.nearest(0.0, 0.0, now_ns=16 * S) == 2
    known.on_roll(roll(16, 5, 0, 0, 0), now_ns=17 * S)
    assert known.nearest(0.0, 0.0, now_ns=17 * S) == 2, "who has heard it no later knows no better"
    known.on_roll(roll(20, 1, 0, 0, 0), now_ns=20 * S)
    assert known.nearest(0.0, 0.0, now_ns=20 * S) == 1, "it was heard again"
    known.on_roll(roll(26, 5, 0, 0, 0, lost=(0, 1, 2)), now_ns=26 * S)
    assert known.nearest(0.0, 0.0, now_ns=26 * S) == 1, "all are lost"
    known.on_status(status(3, 27, 300.0))
    assert known.nearest(0.0, 0.0, now_ns=28 * S) == 3, "it speaks to the post itself"


def test_the_post_hears_the_rolls_in_hellos(make_scenario: Any) -> None:
    orders = [{"at_s": 18.0, "order": "stay", "place_m": [0.0, 0.0]}]
    scenario = make_scenario(**KEYS, orders=orders, duration_s=60)
    post = Uav(scenario, POST, "u", position=Enu(0.0, -150.0, 0.0))
    assert post._post is not None
    plan = Search(1, 100.0, 10.0, 50.0, 50.0, 7.5, 10, 1, 1, (1, 2, 3, 0), 2, 0, 0)
    for told in (plan, status(1, 10, 10.0), status(2, 10, 90.0), roll(16, 5, 0, 0, 0, lost=(0,))):
        post._post.on_hello(bytes(HEADER_BYTES) + told.encode_frame(2), 16 * S)
    assert [told.order.node for told in given_by(post, since_ns=16 * S, until_ns=20 * S)] == [2]
