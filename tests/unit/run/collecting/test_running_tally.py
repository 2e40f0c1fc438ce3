"""What a run has achieved so far: timelines of trace records."""

from kit import MakeScenario

from fanet_mw.trace import Confirmed, Delivered, Generated, Refuted
from fanet_mw.units import MS, S
from fanet_mw.wire.survivors import person_id
from sim.run.collecting.running_tally import RunningTally


def tally(make_scenario: MakeScenario) -> RunningTally:
    return RunningTally(make_scenario(**{"nodes.count": 4, "duration_s": 300, "routing.lifetime_s": 10}))


def send(found: RunningTally, seq: int, *, at_s: float, arrives: int) -> None:
    """Node 1 sends a packet that arrives at so many of three nodes."""
    t_ns = round(at_s * S)
    found.take_records([Generated(t_ns, 1, seq, "traffic", 100)])
    found.take_records([Delivered(t_ns + 50 * MS, node, 1, seq, 50 * MS, 1) for node in range(2, 2 + arrives)])


def test_nothing_is_said_before_packets_are_ripe(make_scenario: MakeScenario) -> None:
    found = tally(make_scenario)
    for second in range(9):
        send(found, second, at_s=second, arrives=3)
    assert found.delivered_share() is None


def test_a_short_run_does_not_wait_for_a_lifetime(make_scenario: MakeScenario) -> None:
    found = RunningTally(make_scenario(**{"nodes.count": 4, "duration_s": 20, "routing.lifetime_s": 10}))
    for second in range(7):
        send(found, second, at_s=second, arrives=3)
    assert found.delivered_share() == 1.0


def test_the_share_counts_every_ripe_packet_once(make_scenario: MakeScenario) -> None:
    found = tally(make_scenario)
    for second in range(100):
        send(found, second, at_s=second, arrives=2)
    assert found.delivered_share() == 2 / 3
    for second in range(100, 150):
        send(found, second, at_s=second, arrives=0)
    ripe = 139  # those until second 138, ten seconds before it was last counted
    assert found.delivered_share() == 200 / (3 * ripe)


def test_copies_that_take_seconds_count_and_other_packets_do_not(make_scenario: MakeScenario) -> None:
    found = tally(make_scenario)
    for second in range(60):
        found.take_records(
            [Generated(second * S, 1, second, "traffic", 100), Generated(second * S, 2, 900, "report", 30)]
        )
        late = second - 7
        found.take_records(Delivered(second * S, node, 1, late, 7 * S, 1) for node in (2, 3, 4) if late >= 0)
        found.take_records([Delivered(second * S, 3, 2, 900, MS, 1)] * 2)
    assert found.delivered_share() == 1.0
    assert sum(map(len, found._copies)) + len(found._sent) < 60, "what is ripe is forgotten"


def test_nothing_is_kept_of_packets_while_the_traffic_rests(make_scenario: MakeScenario) -> None:
    found = tally(make_scenario)
    for second in range(200):
        found.take_records([Generated(second * S, 2, second, "report", 30), Delivered(second * S, 3, 2, second, MS, 1)])
    assert sum(map(len, found._copies)) < 30
    assert found.delivered_share() is None


PLACES = ((100.0, 0.0), (200.0, 0.0), (300.0, 0.0))


def search(make_scenario: MakeScenario) -> RunningTally:
    """Of a scenario with three survivors at known places."""
    survivors = {"mission.survivors": 3, "mission.survivor_positions_m": PLACES}
    return RunningTally(make_scenario(**{"nodes.count": 4, **survivors}))


def test_a_confirmation_that_is_taken_back_does_not_count(make_scenario: MakeScenario) -> None:
    found = search(make_scenario)
    found.take_records(
        [Confirmed(S, 1, 2, 200.0, 0.0), Confirmed(S, 2, 2, 200.0, 0.0), Confirmed(2 * S, 1, 3, 300.0, 0.0)]
    )
    assert found.confirmed == {2, 3}
    found.take_records([Refuted(3 * S, 1, 3, 300.0, 0.0)])
    assert found.confirmed == {2}


def test_a_run_that_is_watched_never_confirms_more_survivors_than_there_are(make_scenario: MakeScenario) -> None:
    found = search(make_scenario)
    found.take_records(
        [Confirmed(S, 1, 1, 101.0, 0.0), Confirmed(S, 2, 77, 100.0, 0.0), Confirmed(S, 3, 2, 260.0, 0.0)]
    )
    found.take_records([Confirmed(2 * S, 1, person_id(1, 1), 101.0, 5.0)])
    assert found.confirmed == {1}, "no survivor has the number 77, and survivor 2 is elsewhere"
    assert found.without_phone == set(), "the person is survivor 1"
    found.take_records([Confirmed(2 * S, node, person_id(node, 1), 300.0, 5.0) for node in (1, 2)])
    assert found.confirmed == {1}
    assert found.without_phone == {3}


def test_copies_count_at_the_targets_alone(make_scenario: MakeScenario) -> None:
    found = RunningTally(make_scenario(**{"nodes.count": 4, "duration_s": 20, "traffic.targets": [4]}))
    for second in range(10):
        send(found, second, at_s=second, arrives=2)
    assert found.delivered_share() == 0.0, "node 4 got none"
