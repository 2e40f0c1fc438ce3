"""A node's calls, by hand: a window of 40 ms, turns of 2 ms, superframes of 100 ms, two calls in each."""

from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.turn_release import CallRelease, TurnsInForce
from fanet_mw.scenario import Routing
from fanet_mw.units import MS, NodeId
from fanet_mw.wire import PRIORITY_BULK, Header, Kind

TURNS = Turns(origin_ns=0, period_ns=100 * MS, contention_ns=40 * MS, turn_ns=2 * MS, per_superframe=29)


def test_each_call_is_reserved_once() -> None:
    calls = CallRelease(TxQueue(Routing()), lead_ns=5 * MS)
    calls.follow([TurnsInForce(0, TURNS, (0, 10), 500, 1)], now_ns=0)
    assert [calls.reserve(not_before_ns=0, now_ns=0) for _ in range(4)] == [40 * MS, 60 * MS, 140 * MS, 160 * MS]
    assert calls.has_turn(now_ns=0)


def test_what_is_queued_last_goes_behind_the_others_in_calls_that_come_soon_enough_and_are_not_reserved() -> None:
    calls = CallRelease(TxQueue(Routing()), lead_ns=5 * MS)
    calls.follow([TurnsInForce(0, TURNS, (0, 10), 500, 1)], now_ns=0)
    for seq in (1, 2):
        header = Header(seq, seq, NodeId(3), NodeId(4), NodeId(3), Kind.DATA, 32, 0, PRIORITY_BULK, 0)
        calls.push(Packet(header, bytes(100)), now_ns=0)
    assert [calls.last_ns(now_ns=now * MS) for now in (0, 35, 36)] == [60 * MS, 60 * MS, 140 * MS]
    assert calls.reserve(not_before_ns=0, now_ns=0) == 40 * MS
    assert calls.last_ns(now_ns=0) == 140 * MS


def test_without_calls_none_is_reserved() -> None:
    calls = CallRelease(TxQueue(Routing()), lead_ns=5 * MS)
    calls.follow([TurnsInForce(0, TURNS, (), 500, 1)], now_ns=0)
    assert calls.reserve(not_before_ns=0, now_ns=0) is None
    assert not calls.has_turn(now_ns=0)


def test_a_call_after_the_end_of_a_plan_goes_by_the_next_one() -> None:
    calls = CallRelease(TxQueue(Routing()), lead_ns=5 * MS)
    calls.follow([TurnsInForce(0, TURNS, (0, 10), 500, 1), TurnsInForce(100 * MS, TURNS, (5,), 500, 1)], now_ns=0)
    assert [calls.reserve(not_before_ns=0, now_ns=0) for _ in range(4)] == [40 * MS, 60 * MS, 150 * MS, 250 * MS]


def test_a_plan_without_calls_ends_those_of_the_plan_before() -> None:
    calls = CallRelease(TxQueue(Routing()), lead_ns=5 * MS)
    calls.follow([TurnsInForce(0, TURNS, (0,), 500, 1), TurnsInForce(100 * MS, TURNS, (), 500, 1)], now_ns=0)
    assert [calls.reserve(not_before_ns=0, now_ns=0) for _ in range(2)] == [40 * MS, None]
