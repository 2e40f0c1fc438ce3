"""What a run has achieved so far: timelines of trace records."""

from kit import MakeScenario

from fanet_mw.trace import Confirmed, Delivered, Generated, Refuted
from fanet_mw.units import MS, S
from sim.run.collecting.running_tally import RunningTally


def tally(make_scenario: MakeScenario) -> RunningTally:
    return RunningTally(make_scenario(**{"nodes.count": 4}))


def send(found: RunningTally, seq: int, *, at_s: float, arrives: int) -> None:
    """Node 1 sends a packet that arrives at so many of three nodes."""
    t_ns = round(at_s * S)
    found.take([Generated(t_ns, 1, seq, "traffic", 100)])
    found.take([Delivered(t_ns + 50 * MS, node, 1, seq, 50 * MS, 1) for node in range(2, 2 + arrives)])


def test_nothing_is_said_before_packets_are_ripe(make_scenario: MakeScenario) -> None:
    found = tally(make_scenario)
    for second in range(9):
        send(found, second, at_s=second, arrives=3)
    assert found.delivered_share() is None


def test_the_share_counts_every_ripe_packet_once(make_scenario: MakeScenario) -> None:
    found = tally(make_scenario)
    for second in range(100):
        send(found, second, at_s=second, arrives=2)
    assert found.delivered_share() == 2 / 3
    for second in range(100, 150):
        send(found, second, at_s=second, arrives=0)
    ripe = 131  # those until second 130, when it was last counted: every ten seconds
    assert found.delivered_share() == 200 / (3 * ripe)


def test_copies_that_take_seconds_count_and_other_packets_do_not(make_scenario: MakeScenario) -> None:
    found = tally(make_scenario)
    for second in range(60):
        found.take([Generated(second * S, 1, second, "traffic", 100), Generated(second * S, 2, 900, "report", 30)])
        late = second - 7
        found.take(Delivered(second * S, node, 1, late, 7 * S, 1) for node in (2, 3, 4) if late >= 0)
        found.take([Delivered(second * S, 3, 2, 900, MS, 1)] * 2)
    assert found.delivered_share() == 1.0
    assert len(found._copies) + len(found._older_copies) + len(found._sent) < 60, "what is ripe is forgotten"


def test_a_confirmation_that_is_taken_back_does_not_count(make_scenario: MakeScenario) -> None:
    found = tally(make_scenario)
    found.take([Confirmed(S, 1, 7, 0.0, 0.0), Confirmed(S, 2, 7, 0.0, 0.0), Confirmed(2 * S, 1, 8, 0.0, 0.0)])
    assert found.confirmed == {7, 8}
    found.take([Refuted(3 * S, 1, 8, 0.0, 0.0)])
    assert found.confirmed == {7}
