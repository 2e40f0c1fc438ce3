"""The clock of one node, of whichever, jumps by 1 ms to 10 s: what becomes of the bounds stated after the jump.

    python tests/hostile/jumps.py [DRAWS [FIRST SEED [clustered | rounds]]]

By default 40 draws of clustered floods, each with a counter and without.

With a counter (`clock.counter`, the default) no bound that is stated after the jump may be broken. Within 15 s all
nodes are within 100 us again, or the one that cannot be is counted as without time. Without a counter nobody can know
of the jump before some hellos were heard: bounds stated until then are counted, and those stated later must be kept.
"""

import math
import sys
from collections import Counter, defaultdict
from random import Random
from typing import Final, NamedTuple

from fanet_mw.trace import BoundExcludes, BoundStated, ClockSampled, Delivered, Generated
from fanet_mw.units import US, S
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

KEYS: Final = (
    "clock.sync=beacons", "nodes.count=15", "clusters.count=14", "traffic.sources=14", "clusters.turn_slack_us=400",
    "warmup_s=34", "clock.offset_ms=5", "clock.drift_ppm=20", "duration_s=64",
)  # fmt: skip
PROTOCOLS: Final = {
    "clustered": (),
    "rounds": (
        "routing.protocol=rounds", "rounds.turn_slack_us=400", "rounds.bulk_share=0", "traffic.payload_bytes=300",
    ),
}  # fmt: skip
REUNITED_S: Final = 15
UNKNOWN_S: Final = 4
"""A node that has no counter gives up its time 1.5 hello intervals after the jump, and its alarm goes from hello to
hello through the swarm."""
NODES: Final = 15


class Jump(NamedTuple):
    seed: int
    node: int
    at_s: float
    by_ms: float
    counter: bool
    protocol: str = "clustered"

    def __str__(self) -> str:
        seen = "a counter" if self.counter else "no counter"
        return f"{self.protocol}, seed {self.seed}, node {self.node} at {self.at_s:g} s by {self.by_ms:g} ms, {seen}"


class Seen(NamedTuple):
    """What became of the packets with a bound that was stated after the jump."""

    stated: int
    excluding: int
    """Those of them that exclude a node."""
    late: int
    never: int
    last_broken_s: float
    """How long after the jump the last packet was generated that came late, or never to all."""
    reunited_s: float | None
    """After this time all clocks stayed within 100 us of each other; those without time do not count."""
    without_time: int
    jumps: int

    def kept(self, jump: Jump) -> bool:
        together = self.reunited_s is not None and self.reunited_s <= REUNITED_S
        if jump.counter:
            return together and self.jumps == 1 and not (self.late or self.never)
        return together and self.last_broken_s <= UNKNOWN_S


def drawn(seed: int, *, counter: bool, protocol: str = "clustered") -> Jump:
    random = Random(f"jump/{seed}")
    node = random.choice([1, random.randint(2, NODES)])
    by_ms = round(random.choice([-1, 1]) * math.exp(random.uniform(0, math.log(10_000))), 3)
    return Jump(random.randint(1, 5), node, round(random.uniform(36, 42), 3), by_ms, counter, protocol)


def run(jump: Jump) -> Seen:
    counter = f"clock.counter={str(jump.counter).lower()}"
    jumps = f"clock.jumps=[[{jump.node}, {jump.at_s}, {jump.by_ms}]]"
    scenario = catalog.find("clusters", [*KEYS, *PROTOCOLS[jump.protocol], counter, jumps, f"seed={jump.seed}"])
    outcome = simulate(scenario)
    summary = finish(outcome, out=None)
    born: dict[tuple[int, int], int] = {}
    stated: dict[tuple[int, int], int] = {}
    came: dict[tuple[int, int], dict[int, int]] = defaultdict(dict)
    excluded: dict[tuple[int, int], set[int]] = defaultdict(set)
    samples: dict[int, list[ClockSampled]] = defaultdict(list)
    for record in outcome.records:
        if isinstance(record, Generated):
            born[record.node, record.seq] = record.t_ns
        elif isinstance(record, BoundStated) and record.t_ns >= jump.at_s * S:
            stated[record.node, record.seq] = record.bound_ns
        elif isinstance(record, BoundExcludes):
            excluded[record.node, record.seq].add(record.other)
        elif isinstance(record, Delivered):
            came[record.origin, record.seq][record.node] = record.t_ns
        elif isinstance(record, ClockSampled):
            samples[record.t_ns].append(record)
    found: Counter[str] = Counter()
    last_ns = 0
    for key, bound_ns in stated.items():
        t_ns = born[key]
        if t_ns < (scenario.duration_s - 3) * S:
            found["stated"] += 1
            out = excluded[key]
            found["excluding"] += bool(out)
            late = any(at_ns > t_ns + bound_ns for node, at_ns in came[key].items() if node not in out)
            never = len(out | came[key].keys()) < NODES - 1
            found["late"] += late
            found["never"] += never
            if late or never:
                last_ns = max(last_ns, t_ns)
    apart = [t_ns for t_ns, of in samples.items() if t_ns >= jump.at_s * S and _apart_ns(of) > 100 * US]
    reunited_s = max(apart) / S + 1 - jump.at_s if apart else 0.0
    seen = sum(report.get("clock", {}).get("jumps", 0) for report in outcome.reports.values())
    return Seen(
        found["stated"], found["excluding"], found["late"], found["never"], max(0.0, last_ns / S - jump.at_s),
        reunited_s if reunited_s < scenario.duration_s - jump.at_s else None, summary["clock"]["without_time"], seen,
    )  # fmt: skip


def _apart_ns(samples: list[ClockSampled]) -> int:
    known = [sample.ahead_ns for sample in samples if sample.bound_ns >= 0]
    return max(known, default=0) - min(known, default=0)


def main() -> int:
    given = sys.argv[1:]
    count, first, protocol = (*given, *("40", "1", "clustered")[len(given) :])
    wrong = 0
    for seed in range(int(first), int(first) + int(count)):
        for counter in (True, False):
            jump = drawn(seed, counter=counter, protocol=protocol)
            seen = run(jump)
            wrong += not seen.kept(jump)
            again = "never" if seen.reunited_s is None else f"{seen.reunited_s:.1f} s"
            print(
                f"{jump}: {seen.stated} bounds stated after it, {seen.excluding} without a node, {seen.late} late, "
                f"{seen.never} never with all (the last {seen.last_broken_s:.1f} s after it), together again after "
                f"{again}, {seen.without_time} without time: {'kept' if seen.kept(jump) else 'NOT KEPT'}",
                flush=True,
            )
    print(f"{2 * int(count)} runs, {wrong} not kept")
    return min(wrong, 1)


if __name__ == "__main__":
    sys.exit(main())
