"""What one UAV floods and passes on in hellos, and when: to the nanosecond, in order, and no more."""

from types import SimpleNamespace
from typing import cast

import pytest
from seeing_uav import MODEL

from agents.mission.finding.announcing import Announcing
from agents.mission.finding.known_survivors import KnownSurvivor, KnownSurvivors
from agents.mission.finding.phone_localization import Estimate, PhoneFilter
from agents.mission.outbox import Outbox
from fanet_mw.trace import Confirmed, PlacedInside, Refuted
from fanet_mw.units import MS, US, Enu, NodeId, S
from fanet_mw.wire.search_messages import told_in
from fanet_mw.wire.survivors import Found, Standing, Survivor, person_id

PLACE = Estimate(10.126, -20.006, 4.0, 0.5, 3.0)


class Uav:
    """One UAV that knows of verdicts."""

    def __init__(self, node: int = 8) -> None:
        self.survivors, self.out = KnownSurvivors(MODEL), Outbox()
        self.announcing = Announcing(NodeId(node), self.survivors, self.out)

    def learn(self, *survivors: int, at_ns: int) -> None:
        """Learn the verdicts of other UAVs."""
        for survivor in survivors:
            found = Found(at_ns // US, survivor, 50.0 * survivor, 0.0, 4.0, 0.0, 4.0, 3, Standing.CONFIRMED)
            self.survivors.on_found(found, now_ns=at_ns)
            self.announcing.decided(survivor, at_ns)

    def flooded(self) -> list[Found]:
        """What was flooded since the last look."""
        told = [message for packet in self.out.packets for message in told_in(bytes(36) + packet.frames)]
        self.out.packets.clear()
        return [message for message in told if isinstance(message, Found)]

    def numbers(self, now_ns: int, *, task: int | None = None) -> list[int]:
        self.announcing.tell(task, now_ns)
        return [found.survivor for found in self.flooded()]

    def in_hello(self, now_ns: int) -> list[int]:
        told = told_in(bytes(36) + self.announcing.hello_frames(now_ns))
        return [found.survivor for found in told if isinstance(found, Found)]

    def estimate(self, sigma_m: float) -> None:
        place = Estimate(0.0, 0.0, sigma_m**2, 0.0, 0.0)
        heard = SimpleNamespace(
            estimate=lambda: place, is_seen=False, on_sighting=lambda _: None, calibrate=lambda _: None, readings=[]
        )
        self.survivors.by_id[1] = KnownSurvivor(cast("PhoneFilter", heard))


def test_a_verdict_of_its_own_is_flooded_three_times_7_s_apart() -> None:
    uav = Uav()
    uav.announcing.place_inside(2, PLACE, 5 * S)
    for now_ns, told in (
        (5 * S, [2]), (12 * S - 1, []), (12 * S, [2]), (19 * S - 1, []), (19 * S, [2]), (26 * S, []), (60 * S, []),
    ):  # fmt: skip
        assert uav.numbers(now_ns) == told, now_ns
    assert uav.out.records == [PlacedInside(5 * S, NodeId(8), 2, 10.13, -20.01)]
    assert uav.survivors.by_id[2].settled == Found(5 * S // US, 2, *PLACE, 8, Standing.INSIDE)
    assert uav.in_hello(17 * S - 1) == [2]


def test_several_verdicts_go_in_order_of_id_and_one_that_is_not_due_holds_up_none() -> None:
    uav = Uav()
    uav.announcing.place_inside(1, PLACE, 5 * S)
    assert uav.numbers(6 * S) == [1]
    for survivor in (9, 4):
        uav.announcing.place_inside(survivor, PLACE, 7 * S)
    assert uav.numbers(7 * S) == [4, 9]
    assert uav.numbers(13 * S) == [1]


def test_who_does_not_know_a_verdict_is_told_after_7_s_and_not_again_within_7_s() -> None:
    uav = Uav(node=8)
    uav.learn(1, at_ns=5 * S)
    report = Survivor(0, 1, 4, Enu(0, 0, 60), -70.0)
    for now_ns, told in ((12 * S, 0), (12 * S + 1, 1), (19 * S + 1, 0), (19 * S + 2, 1)):
        uav.announcing.reported(report, now_ns)
        assert len(uav.flooded()) == told, now_ns
    uav.announcing.reported(report._replace(survivor=2), 90 * S)
    assert uav.flooded() == [], "of whom nothing is known"
    uav.survivors.on_found(Found(0, 3, 0, 0, 4, 0, 4, 3, Standing.CONFIRMED), now_ns=0)
    uav.announcing.reported(report._replace(survivor=3), 90 * S)
    assert uav.flooded() == [], "what it has only just learned"


def test_one_in_four_reminds_and_the_others_wait_as_if_they_had() -> None:
    for reporter, told in ((2, 0), (3, 1), (4, 0), (5, 0)):
        uav = Uav(node=9)
        uav.learn(1, at_ns=0)
        uav.announcing.reported(Survivor(0, 1, reporter, Enu(0, 0, 60), -70.0), 9 * S)
        assert len(uav.flooded()) == told
        uav.announcing.reported(Survivor(0, 1, 3, Enu(0, 0, 60), -70.0), 16 * S)
        assert uav.flooded() == []


def test_a_hello_passes_on_the_three_newest_verdicts_of_the_last_12_s() -> None:
    uav = Uav()
    for second, survivor in enumerate((5, 2, 9, 4), start=1):
        uav.learn(survivor, at_ns=second * S)
    assert uav.in_hello(5 * S) == [4, 9, 2]
    assert uav.in_hello(15 * S - 1) == [4, 9]
    assert uav.in_hello(15 * S) == [4]


def test_while_the_post_is_in_reach_a_third_of_a_hello_goes_round_all_other_verdicts() -> None:
    uav = Uav()
    uav.learn(1, 2, 3, at_ns=0)
    uav.learn(7, at_ns=19 * S)
    uav.learn(8, at_ns=20 * S)
    uav.learn(9, at_ns=21 * S)
    uav.announcing.on_post(21 * S)
    assert [uav.in_hello(22 * S) for _ in range(5)] == [[9, 8, other] for other in (1, 2, 3, 7, 1)]
    assert uav.in_hello(26 * S - 1) == [9, 8, 2]
    assert uav.in_hello(26 * S) == [9, 8, 7], "it was not heard for 5 s"
    alone = Uav()
    alone.learn(1, 2, 3, 4, at_ns=0)
    alone.announcing.on_post(40 * S)
    assert [alone.in_hello(40 * S) for _ in range(5)] == [[1, 2, 3], [2, 3, 4], [3, 4, 1], [4, 1, 2], [1, 2, 3]]
    nothing = Uav()
    nothing.announcing.on_post(40 * S)
    assert nothing.in_hello(40 * S) == []


@pytest.mark.parametrize("node", range(1, 8))
def test_who_hears_a_lost_one_again_waits_for_its_turn_of_150_ms(node: int) -> None:
    uav = Uav(node)
    uav.learn(1, at_ns=0)
    uav.announcing.on_returned(40 * S)
    due_ns = 40 * S + node % 6 * 150 * MS
    uav.announcing.on_returned(40 * S + 1 * MS)
    assert uav.numbers(due_ns - 1) == []
    assert uav.numbers(due_ns) == [1]
    assert uav.numbers(due_ns + 10 * S) == [], "once"


def test_those_who_meet_are_told_the_newest_first_and_none_that_was_flooded_within_4_s() -> None:
    uav = Uav(node=6)
    for second, survivor in enumerate((3, 1, 2, 5)):
        uav.learn(survivor, at_ns=second * S)
    uav.learn(4, at_ns=2 * S)
    found = uav.survivors.verdict(5)
    assert found is not None
    for flooded_ns, told in ((36 * S, [2, 4, 1, 3]), (36 * S - 1, [5, 2, 4, 1, 3])):
        uav.announcing._flooded_ns.clear()
        uav.announcing.repeated(found, flooded_ns)
        uav.announcing.on_returned(40 * S)
        assert uav.numbers(40 * S) == told
    uav.announcing.on_returned(44 * S)
    assert uav.numbers(44 * S) == [], "it has just told all"
    uav.announcing.on_returned(44 * S + 1)
    assert len(uav.numbers(44 * S + 1)) == 5


def test_an_estimate_is_flooded_from_60_m_on_and_again_when_it_has_become_a_fifth_better() -> None:
    uav = Uav()
    for sigma_m, told in ((60.1, []), (60.0, [1]), (48.1, []), (48.0, [1]), (48.0, []), (10.0, [1])):
        uav.estimate(sigma_m)
        assert uav.numbers(3 * S, task=1) == told, sigma_m
    assert uav.numbers(3 * S) == [], "nobody is flown to"
    uav.announcing.decided(1, 4 * S)
    assert uav.numbers(5 * S, task=1) == [1], "after a verdict it counts anew"
    uav.estimate(8.0)
    uav.announcing.tell(1, 6 * S)
    (found,) = uav.flooded()
    assert found == Found(6 * S // US, 1, 0.0, 0.0, 64.0, 0.0, 0.0, 8, Standing.ESTIMATED)


def test_a_verdict_states_who_made_it_when_and_where() -> None:
    uav = Uav(node=7)
    uav.announcing.report_person(PLACE, 3 * S)
    uav.announcing.report_person(PLACE._replace(north_m=99.0), 3 * S)
    assert uav.survivors.persons[person_id(7, 3)] == Found(3 * S // US, person_id(7, 3), *PLACE, 7, Standing.CONFIRMED)
    assert person_id(7, 4) in uav.survivors.persons
    uav.estimate(4.0)
    uav.announcing.confirm(1, 5 * S)
    confirmed = uav.survivors.by_id[1].confirmed
    assert confirmed == Found(5 * S // US, 1, 0.0, 0.0, 16.0, 0.0, 0.0, 7, Standing.CONFIRMED)
    uav.announcing.refute(1, 9 * S)
    assert uav.survivors.by_id[1].verdict == confirmed._replace(t_us=9 * S // US, standing=Standing.REFUTED)
    assert [type(record) for record in uav.out.records] == [Confirmed, Confirmed, Confirmed, Refuted]
    assert uav.out.records[-1] == Refuted(9 * S, NodeId(7), 1, 0.0, 0.0)


def test_whom_a_uav_finds_after_a_restart_is_nobody_whom_it_found_before() -> None:
    before, others = Uav(node=7), Uav(node=2)
    before.announcing.report_person(PLACE, 3 * S)
    restarted = Uav(node=7)
    restarted.survivors.on_found(Found(20 * S // US, person_id(7, 20), *PLACE, 7, Standing.CONFIRMED), now_ns=20 * S)
    restarted.announcing.report_person(PLACE._replace(north_m=99.0), 20 * S)
    for uav in (before, restarted):
        for found in uav.survivors.persons.values():
            others.survivors.on_found(found, now_ns=21 * S)
    assert {round(found.north_m) for found in others.survivors.persons.values()} == {round(PLACE.north_m), 99}


def test_who_gives_up_a_person_does_so_for_one_of_a_lower_id_and_says_since_when() -> None:
    uav = Uav(node=7)
    uav.announcing.report_person(PLACE, 0)
    for other in (9, 3):
        found = Found(S // US, person_id(other, 0), *PLACE._replace(east_m=11.0), other, Standing.CONFIRMED)
        uav.survivors.on_found(found, now_ns=S)
        uav.announcing.give_up_doubles(4 * S, steady_m2=1.0)
        verdict = uav.survivors.persons[person_id(7, 0)]
        assert verdict.standing is (Standing.CONFIRMED if other == 9 else Standing.REFUTED)
    assert verdict.t_us == 4 * S // US


def test_a_person_is_kept_where_nobody_else_is() -> None:
    for beside_m, kept in ((0.5, 1), (40.0, 2)):
        uav = Uav(node=7)
        uav.learn(1, at_ns=0)
        uav.announcing.report_person(Estimate(50.0 + beside_m, 0.0, 1.0, 0.0, 1.0), S)
        uav.announcing.keep_person(1, 2 * S, steady_m2=1.0)
        assert len(uav.survivors.person_places()) == kept
