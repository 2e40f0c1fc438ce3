"""Head changes per minute of the clustering methods: `python tests/benchmarks/head_changes.py [SEEDS [SECONDS]]`.

Random waypoint without pause, 45 nodes at 10 m/s, range 250 m, a hello per second, in squares of 2500 m (1.4 neighbors
on average if uniform) and 1000 m (8.6). A change is a node that becomes head or ceases to be. The first
minute is not counted. Received power falls with 30 log10 d. No losses: every hello is heard.
"""

import math
import statistics
import sys
from pathlib import Path
from typing import NamedTuple

sys.path.append(str(Path(__file__).parents[1] / "property"))

from mobic import aggregate_mobility_db2, by_mobility

from fanet_mw.graph.topology import within_range
from fanet_mw.rng import stream
from fanet_mw.routing.clustered.clustering import (
    LastingDegree,
    Maintenance,
    Swarm,
    Weights,
    by_degree,
    by_id,
    heads_of,
)
from fanet_mw.routing.clustered.clustering.head_election import Score
from fanet_mw.units import Enu, NodeId, S

NODES = 45
RANGE_M = 250.0
SPEED_M_S = 10.0
WARMUP_S = 60


class Walk:
    """Random waypoint of the whole swarm, one second a step."""

    def __init__(self, side_m: float, seed: int) -> None:
        self._side_m = side_m
        self._rng = stream(seed, "waypoint", side_m)
        self.positions = {NodeId(n): self._somewhere() for n in range(1, NODES + 1)}
        self._targets = {n: self._somewhere() for n in self.positions}
        self.velocities: dict[NodeId, Enu] = {}
        self.step()

    def _somewhere(self) -> Enu:
        return Enu(self._rng.uniform(0, self._side_m), self._rng.uniform(0, self._side_m), 0.0)

    def step(self) -> None:
        for node, at in self.positions.items():
            way = self._targets[node].minus(at)
            while way.norm() <= SPEED_M_S:
                self._targets[node] = self._somewhere()
                way = self._targets[node].minus(at)
            velocity = Enu(way.east / way.norm() * SPEED_M_S, way.north / way.norm() * SPEED_M_S, 0.0)
            self.velocities[node] = velocity
            self.positions[node] = Enu(at.east + velocity.east, at.north + velocity.north, 0.0)


def power_dbm(distance_m: float) -> float:
    return 30 - 40 - 30 * math.log10(max(1.0, distance_m))


class Ears:
    """The received powers of the last two hellos, per pair in range at both."""

    def __init__(self) -> None:
        self._last: dict[NodeId, dict[NodeId, float]] = {}

    def mobility(self, walk: Walk, adjacency) -> dict[NodeId, float]:
        at = walk.positions
        new = {a: {b: power_dbm(at[a].minus(at[b]).norm()) for b in adjacency[a]} for a in adjacency}
        last, self._last = self._last, new
        return {
            a: aggregate_mobility_db2((last[a][b], power) for b, power in row.items() if b in last.get(a, {}))
            for a, row in new.items()
        }


class Rule(NamedTuple):
    score: Score
    keep: float = math.inf
    contention_s: int = 0
    patient: bool = False


RULES = {
    "lowest-ID, from scratch": Rule(by_id, keep=0.0),
    "MOBIC, from scratch": Rule(by_mobility, keep=0.0),
    "highest degree, kept": Rule(by_degree),
    "WCA, kept": Rule(Weights(RANGE_M)),
    "lowest-ID, kept (LCC)": Rule(by_id),
    "MOBIC, kept": Rule(by_mobility),
    "lasting degree, kept": Rule(LastingDegree(RANGE_M)),
    "lowest-ID, kept, contention 4 s": Rule(by_id, contention_s=4),
    "MOBIC, kept, contention 4 s": Rule(by_mobility, contention_s=4),
    "lasting degree, kept, contention 4 s": Rule(LastingDegree(RANGE_M), contention_s=4),
    "lowest-ID, kept, patient": Rule(by_id, contention_s=4, patient=True),
    "lasting degree, kept, patient": Rule(LastingDegree(RANGE_M), contention_s=4, patient=True),
    "lasting degree, kept, contention 10 s, patient": Rule(LastingDegree(RANGE_M), contention_s=10, patient=True),
}


class Counted(NamedTuple):
    heads: float
    changes_per_min: float
    moves_per_min: float
    """Members that change to another head."""


def run(rule: Rule, *, side_m: float, seed: int, seconds: int) -> Counted:
    walk, ears = Walk(side_m, seed), Ears()
    clusters = Maintenance(rule.score, keep=rule.keep, contention_ns=rule.contention_s * S, patient=rule.patient)
    changes = moves = heads_seen = 0
    heads: frozenset[NodeId] = frozenset()
    head_of: dict[NodeId, NodeId] = {}
    for second in range(WARMUP_S + seconds):
        walk.step()
        adjacency = within_range(walk.positions, range_m=RANGE_M)
        mobility = ears.mobility(walk, adjacency)
        swarm = Swarm(walk.positions, adjacency, mobility=mobility, velocities=walk.velocities)
        found = clusters.step(swarm, now_ns=second * S)
        now = frozenset(heads_of(found))
        now_of = {member: cluster.head for cluster in found for member in cluster.members}
        if second >= WARMUP_S:
            changes += len(now ^ heads)
            moves += sum(1 for n in now_of if n not in now | heads and now_of[n] != head_of[n])
            heads_seen += len(now)
        heads, head_of = now, now_of
    return Counted(heads_seen / seconds, changes * 60 / seconds, moves * 60 / seconds)


def main(seeds: int, seconds: int) -> None:
    for side_m in (2500.0, 1000.0):
        print(f"{NODES} nodes, {side_m:.0f} m, {RANGE_M:.0f} m, {SPEED_M_S:.0f} m/s; {seeds} seeds x {seconds} s")
        print(f"{'method':46} heads  head changes/min (sd)  member moves/min")
        for name, rule in RULES.items():
            runs = [run(rule, side_m=side_m, seed=seed, seconds=seconds) for seed in range(1, seeds + 1)]
            changes = [r.changes_per_min for r in runs]
            heads = statistics.mean(r.heads for r in runs)
            moves = statistics.mean(r.moves_per_min for r in runs)
            spread = statistics.stdev(changes) if seeds > 1 else 0.0
            print(f"{name:46} {heads:5.1f}  {statistics.mean(changes):10.1f} ({spread:.1f}) {moves:18.1f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10, int(sys.argv[2]) if len(sys.argv) > 2 else 600)
