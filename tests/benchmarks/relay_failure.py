"""How long a dead relay cuts others off: `python tests/benchmarks/relay_failure.py [RUNS] [SECONDS] [SOURCES]`.

Scenario `clusters` (9 x 5 grid, collision-free floods, every node a head). At 20 s the radio of a relay falls silent
for good: in run k that of the k-th most used in the timetable. `cut off`: from then until the last packet was generated
that missed a node alive; `missed`: copies among the others that never came; `epochs`: timetables and announcements that
the leader numbered until the end.
"""

import statistics
import sys
from collections import Counter
from collections.abc import Sequence
from typing import Final, NamedTuple

from agents.applications.traffic import sources_of
from fanet_mw.routing.clustered.timetable.node_timetable import FittedTimetable
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.config import build
from fanet_mw.trace import Delivered, Generated
from fanet_mw.units import NodeId, S
from sim.planner.timetable_plan import table_for
from sim.run.virtual import simulate
from sim.scenarios import catalog
from sim.world.environment.layout import positions

KILLED_S = 20
_SOON_S: Final = 10


def most_used(scenario: Scenario) -> list[NodeId]:
    """Relays by how many floods they pass on, most first; the leader has a lease of its own."""
    at = tuple((NodeId(n), place) for n, place in zip(scenario.node_ids, positions(scenario), strict=True))
    fitted = table_for(scenario, at, dict.fromkeys((node for node, _ in at), NodeId(1)))
    assert isinstance(fitted, FittedTimetable)
    used = Counter(turn.node for turn in fitted.table.turns if turn.node not in (turn.root, scenario.leader))
    return [node for node, _ in sorted(used.items(), key=lambda item: (-item[1], item[0]))]


class CutOff(NamedTuple):
    """What the death of one relay did."""

    cut_off_s: float
    missed: int
    epochs: int


def cut_off(scenario: Scenario, victim: NodeId) -> CutOff:
    """A run in which this node falls silent."""
    fault = {"at_s": KILLED_S, "kind": "cut", "node": victim}
    outcome = simulate(build(scenario.model_dump(exclude_none=True) | {"faults": [fault]}))
    begin_ns, end_ns = KILLED_S * S, scenario.traffic_window_ns[1]
    sources = set(sources_of(scenario)) - {victim}
    born = {
        (r.node, r.seq): r.t_ns
        for r in outcome.records
        if isinstance(r, Generated) and r.node in sources and begin_ns <= r.t_ns < end_ns
    }
    copies = Counter((r.origin, r.seq) for r in outcome.records if isinstance(r, Delivered) and r.node != victim)
    others = scenario.nodes.count - 2
    missing = {key: others - copies[key] for key in born if copies[key] < others}
    last_ns = max((born[key] for key in missing), default=begin_ns)
    epochs = [report["epoch"] for name, report in outcome.reports.items() if name == f"agent-{scenario.leader}"]
    return CutOff((last_ns - begin_ns) / S, sum(missing.values()), epochs[0])


def nth(run: int, *, seconds: float, sources: int) -> CutOff:
    """The death of the `run`-th most used relay, watched for so many seconds."""
    settings = [f"duration_s={KILLED_S + seconds}", f"seed={run}", f"traffic.sources={sources}"]
    scenario = catalog.find("clusters", settings)
    victims = most_used(scenario)
    return cut_off(scenario, victims[(run - 1) % len(victims)])


def row(found: Sequence[CutOff], *, sources: int) -> list[str]:
    """A row of the table: how long others were cut off, and what they missed."""
    times = sorted(one.cut_off_s for one in found)
    soon = sum(time_s <= _SOON_S for time_s in times)
    return [
        f"{sources}",
        f"{statistics.median(times):.1f}",
        f"{times[0]:.1f}",
        f"{times[-1]:.1f}",
        f"{soon} of {len(times)}",
        f"{statistics.fmean(one.missed for one in found):.0f}",
        f"{min(one.epochs for one in found)} to {max(one.epochs for one in found)}",
    ]


HEAD: Final = (
    "sources", "median [s]", "least [s]", "worst [s]", f"within {_SOON_S} s", "copies missed, mean", "epochs"
)  # fmt: skip


def main(runs: int, seconds: float, sources: int) -> None:
    found = []
    for run in range(1, runs + 1):
        found.append(nth(run, seconds=seconds, sources=sources))
        print(f"run {run}: {found[-1]}", flush=True)
    for cells in (HEAD, row(found, sources=sources)):
        print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    RUNS, SECONDS, SOURCES, *_ = [*sys.argv[1:], *("20", "50", "10")[len(sys.argv) - 1 :]]
    main(int(RUNS), float(SECONDS), int(SOURCES))
