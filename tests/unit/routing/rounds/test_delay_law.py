"""Delays in rounds: bounds beside more urgent packets, and likely delays from what packets of others took."""

import pytest

from fanet_mw.routing.rounds.delay_law import DelayLaw, LikelyDelay
from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.routing.rounds.topology import Topology
from fanet_mw.units import NodeId, S
from fanet_mw.wire import PRIORITY_REPORT, PRIORITY_SAFETY
from fanet_mw.wire.rounds import HeardNodes
from sim.scenarios import catalog

WAY_NS = 100


def test_nothing_is_likely_before_enough_was_heard() -> None:
    likely = LikelyDelay()
    for _ in range(299):
        likely.hear(50, way_ns=WAY_NS)
    assert likely.over_ns(WAY_NS) is None
    likely.hear(50, way_ns=WAY_NS)
    assert likely.over_ns(WAY_NS) == 62


def test_a_few_late_packets_are_covered_and_scaled_to_the_own_way() -> None:
    likely = LikelyDelay()
    for number in range(600):
        likely.hear(300 if number % 100 == 0 else 50, way_ns=WAY_NS)
    assert likely.over_ns(10 * WAY_NS) == 3125, "one in a hundred is more than the share that may be missing"


def test_what_is_late_beyond_measure_leaves_nothing_to_state() -> None:
    likely = LikelyDelay()
    for number in range(600):
        likely.hear(100 * WAY_NS if number % 100 == 0 else 50, way_ns=WAY_NS)
    assert likely.over_ns(WAY_NS) is None


def test_what_is_long_ago_is_forgotten() -> None:
    likely = LikelyDelay()
    for _ in range(400):
        likely.hear(300, way_ns=WAY_NS)
    for _ in range(8000):
        likely.hear(50, way_ns=WAY_NS)
    assert likely.over_ns(WAY_NS) == 62


def of_two(*keys: str) -> tuple[DelayLaw, Topology]:
    """The law at one of two nodes that hear each other."""
    two = ["routing.protocol=rounds", "nodes.count=2", "clusters.count=1", "traffic.sources=1"]
    scenario = catalog.find("clusters", [*two, *keys])
    law = DelayLaw(RoundTiming.of(scenario), scenario)
    topology = Topology(NodeId(1), count=2, epoch_ns=law.epoch_ns, lifetime_ns=10 * S)
    topology.hear([HeardNodes(2, 0, 1, often=False)], now_ns=0)
    topology.state(2, often=False, now_ns=0)
    return law, topology


def test_nobody_is_left_out_of_bounds_before_hellos_of_all_could_have_come() -> None:
    """Hellos come once per second, the first of each node at any instant of its first second."""
    law, _ = of_two("routing.hello_interval_s=1")
    topology = Topology(NodeId(1), count=3, epoch_ns=law.epoch_ns, lifetime_ns=10 * S)
    topology.hear([HeardNodes(2, 0, 1, often=False)], now_ns=0)
    topology.state(2, often=False, now_ns=0)
    assert [law.absent(topology, now_ns=round(t_s * S)) for t_s in (0, 1.5)] == [None, None]
    assert law.absent(topology, now_ns=3 * S) == (3,)


def test_what_more_urgent_packets_use_of_the_turns_makes_a_bound_longer() -> None:
    law, topology = of_two()

    def stated(priority: int) -> int | None:
        return law.bound_ns(topology, priority=priority, clock_error_ns=0, now_ns=S)

    before = stated(PRIORITY_REPORT), stated(PRIORITY_SAFETY)
    assert None not in before
    for _ in range(3):
        law.count(200, priority=PRIORITY_SAFETY, now_ns=S)
    report, warning = stated(PRIORITY_REPORT), stated(PRIORITY_SAFETY)
    assert report is not None
    assert before[0] is not None
    assert 1.02 * before[0] < report < 2 * before[0]
    assert warning == before[1], "nothing is more urgent than a warning"


def test_packets_alike_make_a_bound_longer_by_the_share_of_turns_that_they_use() -> None:
    """Each has its turn before the next one comes, so nothing waits here; older ones may not have been heard yet."""
    found_ns = {}
    for share in (0.3, 0.7):
        law, topology = of_two()
        every_ns = round(law._timing.period_ns / 2 / share)  # two fill a turn
        for number in range(100):
            law.count(law._room * 3 // 8, priority=PRIORITY_REPORT, now_ns=number * every_ns)
        now_ns = 99 * every_ns + every_ns // 2
        topology.hear([HeardNodes(2, now_ns // law.epoch_ns % 256, 1, often=False)], now_ns=now_ns)
        topology.state(2, often=False, now_ns=now_ns)
        found_ns[share], warning_ns = (
            law.bound_ns(topology, priority=priority, clock_error_ns=0, now_ns=now_ns)
            for priority in (PRIORITY_REPORT, PRIORITY_SAFETY)
        )
        assert warning_ns == law.over_ns(1, longest_bytes=law._greatest), "a warning waits for none of them"
    left = 1 - law._hellos(law._greatest)
    assert found_ns[0.7] - found_ns[0.3] == pytest.approx(0.4 * law._burst_ns / left**2, rel=0.1)


def test_after_a_silence_turns_count_as_empty() -> None:
    law, topology = of_two()
    for number in range(100):
        law.count(100, priority=PRIORITY_REPORT, now_ns=number * law._timing.period_ns)
    now_ns = 100 * law._timing.period_ns + 60 * S
    topology.hear([HeardNodes(2, now_ns // law.epoch_ns % 256, 1, often=False)], now_ns=now_ns)
    topology.state(2, often=False, now_ns=now_ns)
    found_ns = law.bound_ns(topology, priority=PRIORITY_REPORT, clock_error_ns=0, now_ns=now_ns)
    assert found_ns == pytest.approx(law.over_ns(1, longest_bytes=0), rel=1e-3)


def test_no_bound_is_stated_while_packets_of_others_come_so_late_that_turns_must_be_too_few() -> None:
    law, topology = of_two()

    def stated(now_ns: int) -> int | None:
        return law.bound_ns(topology, priority=PRIORITY_REPORT, clock_error_ns=0, now_ns=now_ns)

    law.hear(2 * law.hop_ns, hops=1, priority=PRIORITY_REPORT, now_ns=S)
    assert stated(S) is not None
    law.hear(law.hop_ns + law._burst_ns, hops=1, priority=PRIORITY_REPORT, now_ns=S)
    assert stated(S) is None, "those that are made now wait behind as many again"
    warning_ns = law.bound_ns(topology, priority=PRIORITY_SAFETY, clock_error_ns=0, now_ns=S)
    assert warning_ns is not None, "it waits for none of them"
    assert stated(S + 2 * law._window_ns) is not None


@pytest.mark.parametrize(("interval_s", "states"), [(1.0, True), (0.005, False)])
def test_a_scenario_whose_reports_overfill_turns_has_no_bound_from_its_first_packet_on(
    interval_s: float, *, states: bool
) -> None:
    keys = ["traffic.priority=report", f"traffic.interval_s={interval_s}", "rounds.turn_bytes=1600"]
    law, topology = of_two(*keys)
    found_ns = law.bound_ns(topology, priority=PRIORITY_REPORT, clock_error_ns=0, now_ns=S)
    assert (found_ns is not None) == states


def test_a_hello_that_does_not_fit_beside_a_long_packet_takes_a_turn_of_its_own() -> None:
    """One hello a second, and ten rounds: a tenth of the turns, but no more than every third one."""
    law, _ = of_two("rounds.least_period_ms=100")
    longest = law._timing.turn_bytes - 100
    assert law.turns_of(longest) == pytest.approx(1 / 0.9)
    assert law.over_ns(1, longest_bytes=longest) - law.way_ns(1) == pytest.approx(law._burst_ns / 0.9)
    topology = of_two("rounds.least_period_ms=100")[1]
    alone_ns, beside_ns = (
        law.bound_ns(topology, priority=PRIORITY_REPORT, clock_error_ns=0, now_ns=S, size=size)
        for size in (longest, 100)
    )
    assert alone_ns is not None
    assert beside_ns is not None
    assert alone_ns > beside_ns, "the packet itself counts"
    rare, _ = of_two("rounds.least_period_ms=900")
    assert rare.turns_of(longest) == pytest.approx(1.5)
