"""Whom a leader knows: until when, after a silence or a report of one, and to the nanosecond."""

import pytest

from fanet_mw.motion import Motion
from fanet_mw.routing.clustered.roles.failure_detectors import Liveness
from fanet_mw.routing.clustered.roles.roster import OwnFlight, Roster, alike, sure_m
from fanet_mw.units import MS, STILL, Enu, NodeId, S

NODE, OTHER, REPORTER = NodeId(2), NodeId(5), NodeId(3)
LOST_NS, OBJECTION_NS = 20 * S, 3 * S
HERE = Enu(0.0, 0.0, 50.0)


def at(place: Enu, t_ns: int, velocity: Enu = STILL) -> Motion:
    return Motion(place, velocity, t_ns)


class Leader:
    """A leader that knows of one node since 1 s."""

    def __init__(self, *, sure_m: float | None = 100.0) -> None:
        self.liveness = Liveness()
        self.roster = Roster(
            self.liveness, lost_ns=LOST_NS, objection_ns=OBJECTION_NS, sure_m=sure_m, settled_ns=10 * S
        )
        self.roster.on_join(NODE, at(HERE, 1 * S))

    def report(self, now_ns: int, *, there: Motion | None = None, by: NodeId = REPORTER) -> int | None:
        return self.roster.on_report(NODE, by, there or at(HERE, now_ns), now_ns=now_ns)

    def knows(self, now_ns: int) -> bool:
        self.roster.forget(now_ns)
        return NODE in self.roster


def test_a_node_is_known_for_the_whole_time_in_which_it_may_be_silent() -> None:
    leader = Leader()
    assert leader.knows(21 * S)
    assert not leader.knows(21 * S + 1)
    heard = Leader()
    heard.liveness.on_sign_of_life(NODE, born_ns=4 * S)
    assert heard.knows(24 * S)
    assert not heard.knows(24 * S + 1)


def test_of_whom_it_is_said_that_it_is_lost_sooner_or_later_the_sooner_counts() -> None:
    for lost_ns, until_ns in ((5 * S, 6 * S), (90 * S, 21 * S)):
        leader = Leader()
        for now_ns, known in ((until_ns, True), (until_ns + 1, False)):
            leader.roster.forget(now_ns, lost_ns={NODE: lost_ns, OTHER: 0})
            assert (NODE in leader.roster) is known


def test_a_reported_node_is_forgotten_at_the_end_of_the_time_for_objections() -> None:
    leader = Leader()
    assert leader.report(7 * S) == 10 * S
    assert leader.knows(10 * S - 1)
    assert not leader.knows(10 * S)


def test_a_second_report_gives_no_further_time_and_names_who_stands_in_now() -> None:
    leader = Leader()
    leader.report(7 * S)
    assert leader.report(9 * S, by=OTHER) == 10 * S
    assert leader.roster.stand_ins == {NODE: OTHER}
    assert not leader.knows(10 * S)


def test_any_packet_made_after_the_report_objects_to_it_and_one_made_with_it_does_not() -> None:
    for born_ns, kept in ((7 * S, False), (7 * S + 1, True)):
        leader = Leader()
        leader.report(7 * S + S // 2, there=at(HERE, 7 * S))
        leader.liveness.on_sign_of_life(NODE, born_ns=born_ns)
        assert leader.knows(15 * S) is kept
        assert leader.roster.stand_ins == ({} if kept else {NODE: REPORTER})
    joined = Leader()
    joined.report(7 * S)
    joined.roster.on_join(NODE, at(HERE, 8 * S))
    assert joined.knows(15 * S), "a join is a sign of life, too"


def test_reports_are_forgotten_with_the_nodes_and_those_of_others_are_kept() -> None:
    leader = Leader()
    leader.roster.on_join(OTHER, at(HERE, 9 * S))
    leader.report(7 * S)
    leader.roster.on_report(OTHER, REPORTER, at(HERE, 9 * S), now_ns=9 * S)
    leader.roster.forget(11 * S)
    leader.roster.forget_reports()
    assert leader.roster.stand_ins == {OTHER: REPORTER}
    assert leader.roster.on_report(NODE, REPORTER, at(HERE, 12 * S), now_ns=12 * S) is None, "nobody by that id"


@pytest.mark.parametrize(
    ("there_m", "velocity_m_s", "counts"),
    [(100.0, 0.0, True), (100.1, 0.0, False), (100.0, 10.0, True), (60.0, -10.0, True), (60.1, -10.0, False)],
)
def test_a_report_counts_if_the_node_was_in_sure_reach_now_and_four_seconds_ago(
    there_m: float, velocity_m_s: float, *, counts: bool
) -> None:
    leader = Leader()
    there = at(Enu(there_m, 0.0, 50.0), 8 * S, Enu(velocity_m_s, 0.0, 0.0))
    assert leader.report(8 * S, there=there) == (11 * S if counts else None)
    assert leader.roster.stand_ins == ({NODE: REPORTER} if counts else {})


def test_without_a_radius_of_sure_reach_every_report_counts() -> None:
    assert Leader(sure_m=None).report(8 * S, there=at(Enu(1e5, 0.0, 50.0), 8 * S)) == 11 * S
    assert sure_m(200.0) == 180.0


def test_a_position_is_news_if_it_was_born_later_than_the_known_one() -> None:
    roster = Leader().roster
    assert [roster.is_news(NODE, born_ns) for born_ns in (S - 1, S, S + 1)] == [False, False, True]
    assert roster.is_news(OTHER, 0)


def test_velocities_are_alike_up_to_two_metres_a_second_in_space() -> None:
    still = at(HERE, 0)
    assert alike(at(HERE, 0, Enu(1.2, 1.6, 0.0)), still)
    assert alike(at(HERE, 0, Enu(0.0, 1.2, -1.6)), still)
    for velocity in (Enu(2.1, 0, 0), Enu(0, -2.1, 0), Enu(0, 0, 2.1), Enu(1.3, 1.3, 1.3)):
        assert not alike(at(HERE, 0, velocity), still)
        assert alike(at(HERE, 0, velocity), at(HERE, 0, velocity))


def test_of_its_own_flight_a_leader_knows_five_instants_a_second_of_the_last_minute() -> None:
    flight = OwnFlight()
    assert flight.at(0) is None
    for tick in range(1001):
        flight.add(at(Enu(tick, 0.0, 50.0), tick * 100 * MS))
    assert len(flight._flown) == 300 + 1
    first_ns = flight._flown[0].at_ns
    assert flight._flown[-1].at_ns - first_ns <= 60 * S
    assert flight.at(first_ns - 200 * MS) is not None
    assert flight.at(first_ns - 200 * MS - 1) is None
    close = flight.at(70 * S + 30 * MS)
    assert close == at(Enu(700.0, 0.0, 50.0), 70 * S + 30 * MS), "by the nearest instant, told for this one"


def test_a_turn_is_the_first_other_velocity_after_an_instant() -> None:
    flight, east, north = OwnFlight(), Enu(10.0, 0.0, 0.0), Enu(0.0, 10.0, 0.0)
    for second, velocity in enumerate((east, north, east, north, north)):
        flight.add(at(HERE, second * S, velocity))
    for then_s, turned_s in ((0, 1), (2, 3)):
        assert flight.turned_ns(at(HERE, then_s * S, east)) == turned_s * S
    assert flight.turned_ns(at(HERE, 1 * S, north)) == 2 * S
    assert flight.turned_ns(at(HERE, 3 * S, north)) is None
    assert flight.turned_ns(at(HERE, 1 * S, east)) == 3 * S, "that of the instant itself is what it is compared with"


def test_signs_of_life_are_the_newest_of_each_node() -> None:
    liveness = Liveness()
    for node, born_ns in ((2, 5), (2, 3), (4, 0), (9, 5)):
        liveness.on_sign_of_life(node, born_ns=born_ns)
    assert [liveness.last_ns(node) for node in (2, 3, 4)] == [5, None, 0]
    assert liveness.alive_below(9, since_ns=5) == 1
    assert liveness.alive_below(9, since_ns=0) == 2
    assert liveness.alive_below(2, since_ns=0) == 0
    liveness.forget(NodeId(2))
    liveness.forget(NodeId(77))
    assert liveness.last_ns(2) is None


def test_nodes_come_in_the_order_of_joins_and_places_and_velocities_by_id() -> None:
    roster = Leader().roster
    roster.on_join(OTHER, at(HERE, S, Enu(1.0, 0.0, 0.0)))
    roster.on_join(NodeId(1), at(HERE, 2 * S, Enu(0.0, 3.0, 0.0)))
    assert roster.nodes == [NODE, OTHER, 1]
    assert list(roster.velocities()) == list(roster.places(5 * S, now_ns=4 * S)) == [1, NODE, OTHER]
    assert roster.places(5 * S, now_ns=4 * S)[NodeId(1)] == Enu(0.0, 9.0, 50.0)
