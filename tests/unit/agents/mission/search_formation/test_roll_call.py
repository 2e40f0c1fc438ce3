"""Who is lost, as all UAVs of a part of the swarm come to know it from hello to hello."""

import random
from collections.abc import Collection

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.mission.navigation.silent_neighbors import SilentNeighbors
from agents.mission.search_formation.formation_planner import plan_of
from agents.mission.search_formation.pattern import fitted
from agents.mission.search_formation.roll_call import RollCall
from agents.mission.search_formation.shapes.contract import Demands, ShapeName
from fanet_mw.errors import LocalProtocolError, MalformedFrameError
from fanet_mw.units import MS, NodeId, S
from fanet_mw.wire import HEADER_BYTES
from fanet_mw.wire.search_messages import LONG_AGO, Roll, told_in
from fanet_mw.wire.search_plan import MOST_PLACES, Search

COUNT = 45


def ring_plan() -> Search:
    pattern = fitted(COUNT, Demands(2500, 131, 250, 65, 7.5), shape=ShapeName.RING)
    assert pattern is not None
    return plan_of(pattern, tuple(range(1, COUNT + 1)), planner=1, start_us=0, deploy_ds=0)


class Swarm:
    """UAVs in a row or a ring that hear the hellos of those beside them."""

    def __init__(self, *, around: bool) -> None:
        self.plan = ring_plan()
        self.calls = {node: RollCall(NodeId(node), hello_interval_s=1.0) for node in self.plan.nodes}
        self.around = around
        self.silent: set[int] = set()
        self.borders: set[int] = set()
        """Nodes whose link to the next one does not exist."""
        self.second = 0
        self._random = random.Random(7)

    def beside(self, node: int) -> list[int]:
        found = []
        for other in (node - 1, node + 1):
            if self.around:
                other = (other - 1) % COUNT + 1
            low = min(node, other) if abs(node - other) == 1 else max(node, other)
            if 1 <= other <= COUNT and low not in self.borders:
                found.append(other)
        return found

    def fly(self, seconds: int, *, loses: float = 0.0) -> None:
        for _ in range(seconds):
            self.second += 1
            for node in self._random.sample(self.plan.nodes, COUNT):
                now_ns = self.second * S + node * 15 * MS
                if node in self.silent:
                    continue
                call = self.calls[node]
                call.review(self.plan, since_ns=0, now_ns=now_ns)
                told = told_in(bytes(HEADER_BYTES) + call.roll(self.plan, now_ns=now_ns).encode_frame(node))[0]
                for other in self.beside(node):
                    if other not in self.silent and self._random.random() >= loses:
                        self.calls[other].on_hello(node, now_ns=now_ns)
                        self.calls[other].on_roll(told, self.plan, now_ns=now_ns)

    def lost(self, *, without: int = 0) -> set[frozenset[int]]:
        """What those who are not silent take to be lost."""
        return {
            frozenset(call.lost) for node, call in self.calls.items() if node not in self.silent and node != without
        }


def test_a_row_of_45_takes_nobody_to_be_lost_while_hellos_get_through() -> None:
    swarm = Swarm(around=False)
    swarm.fly(100, loses=0.1)
    assert swarm.lost() == {frozenset()}


def test_those_beside_a_silent_uav_know_within_4_s_and_all_others_a_second_a_hop_later() -> None:
    swarm = Swarm(around=True)
    swarm.fly(40)
    swarm.silent.add(20)
    swarm.fly(4)
    assert 20 in swarm.calls[19].lost
    assert 20 in swarm.calls[21].lost
    swarm.fly(23)
    assert swarm.lost() == {frozenset({20})}


def test_who_is_heard_again_is_not_lost_any_more() -> None:
    swarm = Swarm(around=True)
    swarm.fly(40)
    swarm.silent.add(20)
    swarm.fly(60)
    swarm.silent.clear()
    swarm.fly(24)
    assert swarm.lost() == {frozenset()}


def test_the_two_parts_of_a_swarm_that_is_cut_take_each_other_to_be_lost_and_agree_again_after_it() -> None:
    swarm = Swarm(around=False)
    swarm.fly(60)
    swarm.borders.add(25)
    swarm.fly(70)
    assert swarm.lost() == {frozenset(range(1, 26)), frozenset(range(26, 46))}
    swarm.borders.clear()
    swarm.fly(46)
    assert swarm.lost() == {frozenset()}


def test_who_is_missed_is_lost_unless_others_have_heard_it_lately() -> None:
    plan, call = ring_plan(), RollCall(NodeId(1), hello_interval_s=1.0)
    for age, is_lost in ((2, False), (30, True)):
        call.on_roll(Roll(40, 1, 1, (0, age, *[0] * (COUNT - 2)), frozenset()), plan, now_ns=20 * S)
        call.miss(2, now_ns=20 * S)
        assert (2 in call.lost) == call.has_news == is_lost
        call = RollCall(NodeId(1), hello_interval_s=1.0)


def test_what_comes_from_another_plan_or_from_the_future_is_not_believed() -> None:
    plan, call = ring_plan(), RollCall(NodeId(1), hello_interval_s=1.0)
    call.on_hello(2, now_ns=10 * S)
    forged = Roll(40, 1, 1, (0,) * COUNT, frozenset(range(1, COUNT)))
    for wrong in (forged, forged._replace(at=20, revision=2), forged._replace(at=20, planner=2)):
        call.on_roll(wrong, plan, now_ns=10 * S)
        assert not call.lost
    call.on_roll(forged._replace(at=20), plan, now_ns=10 * S)
    assert set(call.lost) == set(range(2, COUNT + 1)), "it does not take itself to be lost"


@given(st.lists(st.integers(0, LONG_AGO), max_size=MOST_PLACES), st.integers(0, 2**32 - 1), st.randoms())
def test_a_roll_is_the_same_after_the_air(ages: list[int], at: int, pick: random.Random) -> None:
    lost = frozenset(pick.sample(range(len(ages)), len(ages) // 2))
    heard = told_in(bytes(HEADER_BYTES) + Roll(at, 7, 9, tuple(ages), lost).encode_frame(3))[0]
    assert (heard.at, heard.ages[: len(ages)], heard.lost) == (at, tuple(ages), lost)


def test_a_roll_of_no_plan_is_refused() -> None:
    for wrong in (Roll(1, 0, 1, (), frozenset()), Roll(1, 65535, 1, (), frozenset()), Roll(1, 1, 0, (), frozenset())):
        with pytest.raises(MalformedFrameError):
            told_in(bytes(HEADER_BYTES) + wrong.encode_frame(3))[0]
    with pytest.raises(LocalProtocolError):
        Roll(1, 1, 1, (0,) * 201, frozenset()).encode_frame(3)


def test_who_says_that_it_falls_is_lost_at_once_and_who_is_heard_again_in_flight_is_not() -> None:
    plan = ring_plan()
    call, told = (RollCall(NodeId(node), hello_interval_s=1.0) for node in (1, 45))
    call.on_hello(2, now_ns=10 * S)
    assert not call.lost
    call.on_hello(2, now_ns=11 * S, falls=True)
    assert set(call.lost) == {2}
    told.on_roll(call.roll(plan, now_ns=11 * S), plan, now_ns=12 * S)
    assert set(told.lost) == {2}, "who is out of reach learns it from hellos"
    call.on_hello(2, now_ns=14 * S)
    assert not call.lost


class Radio(SilentNeighbors):
    """Says which neighbors' radios are silent."""

    def __init__(self, *silent: int) -> None:
        self.silent = silent

        self.far: tuple[int, ...] = ()

    def has(self, node: NodeId, *, now_ns: int) -> bool:
        return node in self.silent

    def might_be_heard(self, node: NodeId, *, now_ns: int) -> bool:
        return node not in self.far

    def parted(self, lost: Collection[int], *, now_ns: int) -> tuple[NodeId, ...]:
        return ()


def test_a_neighbor_whose_radio_falls_silent_is_lost_before_a_hello_is_missed_and_that_is_told_once() -> None:
    plan, radio = ring_plan(), Radio()
    call = RollCall(NodeId(1), hello_interval_s=1.0, silent=radio)
    for node in (2, 3):
        call.on_hello(node, now_ns=10 * S)
    radio.silent = (2, 30)
    call.review(plan, since_ns=10 * S, now_ns=11 * S)
    assert set(call.lost) == {2}, "30 was no neighbor"
    assert call.has_news
    call.has_news = False
    call.review(plan, since_ns=10 * S, now_ns=12 * S)
    assert not call.has_news
    call.on_hello(2, now_ns=13 * S)
    assert not call.lost
    assert call.has_news, "all are told that it is back"


def test_a_silent_neighbor_that_others_have_heard_since_is_out_of_reach_and_not_lost() -> None:
    plan, radio = ring_plan(), Radio(2, 3)
    call, other = (RollCall(NodeId(node), hello_interval_s=1.0, silent=radio) for node in (1, 4))
    for node in (2, 3):
        call.on_hello(node, now_ns=10 * S)
        other.on_hello(node, now_ns=10 * S)
    other.on_hello(2, now_ns=11 * S)
    call.on_roll(other.roll(plan, now_ns=11 * S), plan, now_ns=11 * S)
    call.review(plan, since_ns=10 * S, now_ns=12 * S)
    assert set(call.lost) == {3}


def test_who_is_lost_from_afar_takes_nothing_from_the_news_of_a_silent_neighbor() -> None:
    plan, radio = ring_plan(), Radio(2)
    call = RollCall(NodeId(1), hello_interval_s=1.0, silent=radio)
    call.on_hello(2, now_ns=98 * S)
    call.review(plan, since_ns=10 * S, now_ns=100 * S)
    assert {2, 45} <= set(call.lost), "45 was never heard"
    assert call.has_news


def test_who_falls_says_so_before_its_next_hello() -> None:
    plan = ring_plan()
    falling, other = (RollCall(NodeId(node), hello_interval_s=1.0) for node in (2, 40))
    other.on_hello(2, now_ns=10 * S)
    falling.review(plan, since_ns=0, now_ns=10 * S)
    assert not falling.has_news
    falling.review(plan, since_ns=0, falls=True, now_ns=11 * S)
    assert falling.has_news
    other.on_roll(falling.roll(plan, now_ns=11 * S), plan, now_ns=11 * S)
    assert set(other.lost) == {2}
    falling.review(plan, since_ns=0, now_ns=12 * S)
    other.on_hello(2, now_ns=12 * S)
    assert not other.lost, "it has caught itself"


def test_a_neighbor_that_has_flown_out_of_reach_is_not_lost_for_want_of_news_which_go_a_long_way_round() -> None:
    plan, radio = ring_plan(), Radio()
    call = RollCall(NodeId(1), hello_interval_s=1.0, silent=radio)
    for node in (2, 3):
        call.on_hello(node, now_ns=10 * S)
    radio.far = (2,)
    call.review(plan, since_ns=10 * S, now_ns=14 * S)
    assert set(call.lost) == {3}
    call.review(plan, since_ns=10 * S, now_ns=52 * S)
    assert set(call.lost) == set(range(2, COUNT + 1))


def test_who_hears_for_some_seconds_that_it_is_lost_is_mute_and_has_another_level_than_those_beside_it() -> None:
    plan, mute = ring_plan(), {node: RollCall(NodeId(node), hello_interval_s=1.0) for node in (20, 21, 40)}
    lost = frozenset(node - 1 for node in mute)  # their places
    for second in range(10, 15):
        for call in mute.values():
            assert call.mute_level(second * S) == 0, "it may be a mistake that its next hello takes back"
            call.on_roll(Roll(2 * second, 1, 1, (5,) * COUNT, lost), plan, now_ns=second * S)
    levels = {node: call.mute_level(15 * S) for node, call in mute.items()}
    assert levels == {20: 6, 21: 7, 40: 5}, "two in one gap know nothing of each other"
    mute[21].on_roll(Roll(32, 1, 1, (0,) * COUNT, frozenset()), plan, now_ns=16 * S)
    assert mute[21].mute_level(30 * S) == 0, "it is heard again"
