"""The clock of one node jumps in flight: it knows before anybody relies on it, and has the swarm's time again."""

from collections import Counter, defaultdict

import pytest
from kit import slow

from agents.clock.local_clock import LocalClock, SteadyClock
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Clock
from fanet_mw.trace import BoundStated, ClockSampled, Delivered, Generated
from fanet_mw.units import MS, US, NodeId, S
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

AT_S = 32
KEYS = (
    "clock.sync=beacons", "nodes.count=15", "clusters.count=14", "traffic.sources=6", "clusters.turn_slack_us=400",
    "warmup_s=26", "clock.offset_ms=5", "clock.drift_ppm=20", "duration_s=52",
)  # fmt: skip


WITHOUT = ("clock.counter=false", "clusters.resume=false")
"""What a frozen node held back would otherwise come late."""


@pytest.mark.parametrize("by_ms", [-10_000, -300.0, 0.25, 1.0, 5_000])
def test_a_clock_that_jumps_shows_each_instant_back(by_ms: float) -> None:
    clock = LocalClock(Clock(offset_ms=5, drift_ppm=20, jumps=((3, 40.0, by_ms),)), seed=1, node=NodeId(3))
    still = LocalClock(Clock(offset_ms=5, drift_ppm=20), seed=1, node=NodeId(3))
    for true_ns in (0, 39 * S, 40 * S - 1, 40 * S, 41 * S, 90 * S):
        jumped = round(by_ms * MS) if true_ns >= 40 * S else 0
        assert clock.local_ns(true_ns) == still.local_ns(true_ns) + jumped
        clock.pass_time(true_ns, until_ns=100 * S)
        assert abs(clock.true_ns(clock.local_ns(true_ns)) - true_ns) <= 1
    if by_ms > 0:
        assert clock.true_ns(still.local_ns(40 * S) + round(by_ms * MS) // 2) == 40 * S, "a time that is left out"


def test_stamps_from_before_a_jump_and_instants_after_it_are_right_and_a_rate_is_no_jump() -> None:
    table = Clock(drift_ppm=20, wander_ppm=1, offset_ms=5, jumps=((3, 40.0, -300.0), (3, 41.0, 1.0)))
    still = LocalClock(Clock(drift_ppm=20, wander_ppm=1, offset_ms=5), seed=1, node=NodeId(3))
    clock = SteadyClock(LocalClock(table, seed=1, node=NodeId(3)))
    for true_ns, before_ns in (
        (39 * S, 38 * S),
        (40 * S + MS, 40 * S - MS),
        (40 * S + 5 * MS, 40 * S),
        (41 * S - MS, 41 * S - MS),
        (41 * S + MS, 41 * S - 1),
        (50 * S, 50 * S),
    ):
        still.pass_time(true_ns, until_ns=100 * S)
        clock.pass_time(true_ns, until_ns=100 * S)
        for t_ns in (before_ns, true_ns):
            assert clock.local_ns(t_ns) == still.local_ns(t_ns)
        assert clock.true_ns(still.local_ns(true_ns + 2 * S)) == still.true_ns(still.local_ns(true_ns + 2 * S))
    assert clock.jumps == 2


class Slewed(LocalClock):
    """A clock that is made to run faster, and not set."""

    def local_ns(self, true_ns: int) -> int:
        return super().local_ns(true_ns) + true_ns // 2_500


def test_a_clock_that_is_slewed_has_not_jumped() -> None:
    clock = SteadyClock(Slewed(Clock(drift_ppm=20), seed=1, node=NodeId(3)))
    for second in range(9):
        clock.pass_time(second * S, until_ns=9 * S)
    assert clock.jumps == 0


def test_a_jump_of_a_node_that_is_not_there_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"clock\.jumps names node 16, which must be <= nodes\.count = 15"):
        catalog.find("clusters", [*KEYS, "clock.jumps=[[16, 1.0, 1.0]]"])


@pytest.mark.parametrize(("node", "by_ms"), [(8, -2.0), *slow((1, -10_000.0), (8, 300.0), (15, 10_000.0))])
def test_a_node_whose_counter_shows_the_jump_loses_nothing(node: int, by_ms: float) -> None:
    outcome = simulate(catalog.find("clusters", [*KEYS, f"clock.jumps=[[{node}, {AT_S}.3, {by_ms}]]"]))
    summary = finish(outcome, out=None)
    assert outcome.reports[f"agent-{node}"]["clock"]["jumps"] == 1
    assert (summary["pdr"], summary["bound"]["violations"], summary["bound"]["never"]) == (1.0, 0, 0)
    assert (summary["clock"]["lost"], summary["clock"]["beyond_bound"]) == (0, 0)


@pytest.mark.parametrize(
    ("node", "by_ms"),
    [(8, -2_000.0), (1, 300.0), (8, 10_000.0), (8, 300.0), (8, 5.0), (1, -20.0), (15, 1_000.0)],
)
@pytest.mark.slow
def test_without_a_counter_nothing_comes_late_and_the_swarm_is_together_again_or_says_who_is_not(
    node: int, by_ms: float
) -> None:
    outcome = simulate(catalog.find("clusters", [*KEYS, *WITHOUT, f"clock.jumps=[[{node}, {AT_S}.0, {by_ms}]]"]))
    summary = finish(outcome, out=None)
    late = summary["bound"]["violations"] - summary["bound"]["never"]
    assert late <= 2 * (by_ms > 5_000), "what a frozen node held back is lost, or is repaired"
    stated_s = [record.t_ns / S - AT_S for record in outcome.records if isinstance(record, BoundStated)]
    doubted = not [at_s for at_s in stated_s if 11 < at_s < 15]
    assert doubted or not summary["bound"]["violations"], "all have heard that some clock is in doubt"
    left_out = by_ms > 5_000
    assert (summary["clock"]["lost"], summary["clock"]["without_time"]) == (1, int(left_out))
    ahead: dict[int, list[int]] = defaultdict(list)
    for record in outcome.records:
        if isinstance(record, ClockSampled) and not (left_out and record.node == node):
            ahead[record.t_ns].append(record.ahead_ns)
    for t_ns, values in ahead.items():
        if t_ns >= (AT_S + 8) * S or 26 * S <= t_ns < AT_S * S:
            assert max(values) - min(values) < 100 * US, t_ns
    heard = Counter((record.origin, record.seq) for record in outcome.records if isinstance(record, Delivered))
    for record in outcome.records:
        if isinstance(record, Generated) and (AT_S + 6) * S <= record.t_ns < 50 * S and not left_out:
            assert heard[record.node, record.seq] == 14, "everything arrives again"
