"""Who is out for a survivor says so, and the others close ranks until it is back."""

from collections.abc import Collection

import pytest
from search_board import COUNT, LINE, OPEN, PLAN, REACH_M, TAKEN_UP_NS, lane_of

from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.navigation.silent_neighbors import SilentNeighbors
from agents.mission.outbox import Outbox
from agents.mission.search_formation.formation_planner import STATUS_S, FormationPlanner
from agents.mission.search_formation.plan_exchange import PlanExchange
from agents.mission.search_formation.roll_call import RollCall
from agents.mission.search_formation.search_place import SearchPlace
from fanet_mw.errors import MalformedFrameError
from fanet_mw.motion import Motion
from fanet_mw.units import MS, STILL, US, Enu, NodeId, S
from fanet_mw.wire import HEADER_BYTES
from fanet_mw.wire.search_messages import ROLL_NS, Roll, told_in
from fanet_mw.wire.search_plan import SearchStatus

NOW_NS = TAKEN_UP_NS + 40 * S


class Exchange:
    """One UAV's part in the exchange, with the plan."""

    def __init__(
        self, node: NodeId, *, waits: float = 0.5, silent: SilentNeighbors | None = None, uavs: int = COUNT
    ) -> None:
        """`waits`: all its random numbers."""
        self.out, self.motion = Outbox(), OwnMotion(lane_of(node, NOW_NS), OPEN)
        self.place = SearchPlace(node, self.motion, reach_m=REACH_M)
        roll_call = RollCall(node, hello_interval_s=1.0, silent=silent)
        planner = FormationPlanner(
            node, roll_call, expected=COUNT, deploy_speed_m_s=9.0,
            of_few=lambda *_: None, random=lambda: 0.5,
        )  # fmt: skip
        self.plans = PlanExchange(
            node, planner, roll_call, self.place, self.motion, self.out,
            pattern=None, random=lambda: waits, uavs=uavs,
        )  # fmt: skip
        self.plans.on_plan(PLAN, now_ns=NOW_NS)

    def said(self) -> list[SearchStatus]:
        packets, self.out.packets = self.out.packets, []
        return [told_in(bytes(HEADER_BYTES) + packet.frames)[0] for packet in packets]


def test_it_is_absent_from_when_it_goes_until_it_is_near_its_place_again() -> None:
    exchange = Exchange(LINE)
    there = exchange.motion.position
    exchange.plans.be_absent(80, NOW_NS, goes=False)
    assert exchange.said() == []
    exchange.plans.be_absent(80, NOW_NS, goes=True)
    exchange.motion.position = there._replace(north=there.north - 200)
    exchange.plans.be_absent(80, NOW_NS, goes=False)  # it has found somebody, and is on its way back
    exchange.motion.position = there._replace(north=there.north - 130)
    exchange.plans.be_absent(80, NOW_NS, goes=False)
    assert [status.absent for status in exchange.said()] == [True, False]


@pytest.mark.parametrize(("uavs", "times"), [(COUNT, 1), (120, 2), (480, 3)])
def test_a_status_goes_out_the_instant_it_is_due_and_of_many_uavs_each_says_it_less_often(
    uavs: int, times: int
) -> None:
    exchange = Exchange(LINE, waits=0.25, uavs=uavs)
    exchange.plans.start(NOW_NS)
    for due_ns in (NOW_NS + times * S // 2, NOW_NS + times * (S // 2 + round(0.9 * STATUS_S * S))):
        exchange.plans.review(80, due_ns - 1)
        assert exchange.said() == []
        exchange.plans.review(80, due_ns)
        (status,) = exchange.said()
        assert (status.t_us, status.node, status.charge) == (due_ns // US, LINE, 80)


def test_the_others_close_ranks_while_it_is_absent() -> None:
    exchange, out = Exchange(LINE), 7
    for absent, vacant in ((True, {PLAN.nodes.index(out)}), (False, set())):
        status = SearchStatus(NOW_NS // 1000 + (not absent), Enu(0, 0, 65), out, 1, 80, absent)
        exchange.plans.on_status(status, now_ns=NOW_NS)
        exchange.plans.close_ranks(NOW_NS)
        assert exchange.place.pattern is not None
        assert exchange.place.pattern.vacant == vacant


def test_who_is_absent_keeps_its_own_place_in_its_plan() -> None:
    exchange = Exchange(LINE)
    exchange.plans.be_absent(80, NOW_NS, goes=True)
    exchange.plans.close_ranks(NOW_NS)
    assert exchange.place.pattern is not None
    assert exchange.place.pattern.vacant == frozenset()


def test_where_those_of_another_part_are_follows_from_their_statuses_and_hellos() -> None:
    class Radio(SilentNeighbors):
        def __init__(self) -> None: ...

        def parted(self, lost: Collection[int], *, now_ns: int) -> Collection[NodeId]:
            return [NodeId(20), NodeId(21), NodeId(29)]

    now_ns = PLAN.start_us * US - S
    exchange = Exchange(LINE, silent=Radio())
    exchange.plans.on_status(SearchStatus(now_ns // US, Enu(70, 80, 65), 20, 1, 80), now_ns=now_ns)
    exchange.plans.on_hello(21, Motion(Enu(90, 60, 65), STILL, now_ns), now_ns=now_ns)
    exchange.plans.on_roll(
        Roll(now_ns // ROLL_NS, PLAN.planner, PLAN.revision, COUNT * (0,), frozenset({PLAN.nodes.index(29)})),
        flooded=True, now_ns=now_ns,
    )  # fmt: skip
    exchange.plans.close_ranks(now_ns)
    assert set(exchange.place.sought) == {20, 21}, "29 is lost"
    ways = exchange.place.parted_ways(now_ns)
    assert [motion.position for motion in ways.values()] == [Enu(70, 80, 65), Enu(90, 60, 65)]


def who_lost(node: NodeId, out: NodeId, *, waits: float) -> Exchange:
    """A UAV that has heard another one 4 s ago, and finds now that it is lost."""
    exchange = Exchange(node, waits=waits)
    exchange.plans.on_hello(out, Motion(lane_of(out, NOW_NS), Enu(0, 7.5, 0), NOW_NS), now_ns=NOW_NS)
    exchange.plans.close_ranks(NOW_NS + 4 * S)
    return exchange


def test_who_finds_a_neighbor_lost_floods_that_once() -> None:
    exchange, out = Exchange(LINE), NodeId(6)
    motion = Motion(lane_of(out, NOW_NS), Enu(0, 7.5, 0), NOW_NS)
    exchange.plans.on_hello(out, motion, now_ns=NOW_NS)
    told = []
    for after_s in (1, 4, 5, 8):
        exchange.plans.close_ranks(NOW_NS + after_s * S)
        exchange.plans.tell_losses(NOW_NS + after_s * S + S // 2)
        told.append([told_in(bytes(HEADER_BYTES) + packet.frames)[0].lost for packet in exchange.out.packets])
        exchange.out.packets.clear()
    assert told == [[], [{PLAN.nodes.index(out)}], [], []]


def test_who_looks_often_whether_somebody_is_lost_waits_no_longer_to_tell_it() -> None:
    exchange = who_lost(LINE, NodeId(6), waits=0.9)
    for after_ms in range(0, 1000, 100):
        exchange.plans.close_ranks(NOW_NS + 4 * S + after_ms * MS)
    assert len(exchange.out.packets) == 1


@pytest.mark.parametrize(("flooded", "also_lost", "floods"), [(True, False, 0), (False, False, 1), (True, True, 1)])
def test_of_two_who_find_the_same_loss_only_the_first_floods_it(flooded: bool, also_lost: bool, floods: int) -> None:
    out, other = NodeId(6), NodeId(9)
    first, second = who_lost(LINE, out, waits=0.1), who_lost(NodeId(7), out, waits=0.9)
    if also_lost:
        second.plans.on_hello(other, Motion(lane_of(other, NOW_NS), Enu(0, 0, -9.0), NOW_NS), now_ns=NOW_NS + 4 * S)
    for after_ms in range(0, 500, 20):
        now_ns = NOW_NS + 4 * S + after_ms * MS
        first.plans.tell_losses(now_ns)
        second.plans.tell_losses(now_ns)
        for packet in first.out.packets:
            told = told_in(bytes(HEADER_BYTES) + packet.frames)[0]
            second.plans.on_roll(told, flooded=flooded, now_ns=now_ns)
        first.out.packets.clear()
    assert len(second.out.packets) == floods


def test_a_status_of_more_charge_than_a_battery_holds_is_malformed() -> None:
    full = SearchStatus(1, Enu(0, 0, 65), 7, 1, 100)
    assert told_in(bytes(HEADER_BYTES) + full.encode_frame(7))[0] == full
    with pytest.raises(MalformedFrameError, match="101 %"):
        told_in(bytes(HEADER_BYTES) + full._replace(charge=101).encode_frame(7))[0]
