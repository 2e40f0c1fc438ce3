"""How many transmissions and sub-slots one flood takes: `python tests/benchmarks/relay_sets.py`.

Reference grid (200 m, range 250 m) and uniform places at four times its density in the largest connected part; the mean
over 20 roots. `all` is every node relaying; multipoint relays have no schedule: who relays
depends on who was heard first.
"""

import math
import statistics
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

sys.path.append(str(Path(__file__).parents[1] / "property"))

from broadcast_schedule import broadcast_schedule, shortest_relays
from dominating_sets import guha_khuller, wu_li

from fanet_mw.graph.multipoint_relays import multipoint_relays
from fanet_mw.graph.topology import Adjacency, components, levels, within_range
from fanet_mw.rng import stream
from fanet_mw.scenario import grid_columns
from fanet_mw.units import Enu, NodeId

RANGE_M = 250.0
ROOTS = 20


def grid(count: int) -> Adjacency:
    columns = grid_columns(count)
    places = {NodeId(i + 1): Enu(200.0 * (i % columns), 200.0 * (i // columns), 0.0) for i in range(count)}
    return within_range(places, range_m=RANGE_M)


def uniform(count: int) -> Adjacency:
    rng, side = stream(1, "uniform", count), 100.0 * math.sqrt(count)
    places = {NodeId(i + 1): Enu(rng.uniform(0, side), rng.uniform(0, side), 0.0) for i in range(count)}
    adjacency = within_range(places, range_m=RANGE_M)
    part = frozenset(max(components(adjacency), key=len))
    return {n: near for n, near in adjacency.items() if n in part}


def mpr_transmissions(adjacency: Adjacency, root: NodeId) -> int:
    chosen = {n: frozenset(multipoint_relays(n, adjacency)) for n in adjacency}
    heard, waiting, sent = {root}, [root], 0
    while waiting:
        sender = waiting.pop(0)
        sent += 1
        for n in adjacency[sender]:
            if n not in heard:
                heard.add(n)
                if n in chosen[sender]:
                    waiting.append(n)
    return sent


class Floods(NamedTuple):
    """What one flood takes, on the average over roots."""

    hops: float
    """From the root to the node that is farthest from it."""
    by_method: Mapping[str, tuple[float, float]]
    """Transmissions and sub-slots of each method."""
    mpr: float
    """Transmissions with multipoint relays."""


_METHODS: Final = {
    "all": lambda adjacency, root: tuple(adjacency),
    "Wu-Li, rule k": lambda adjacency, root: wu_li(adjacency),
    "Guha-Khuller": lambda adjacency, root: guha_khuller(adjacency),
    "shortest": shortest_relays,
}


def floods(adjacency: Adjacency, *, seed_of: int) -> Floods:
    """Measures floods from roots that are drawn for a swarm of `seed_of` UAVs."""
    roots = stream(1, "roots", seed_of).sample(sorted(adjacency), ROOTS)
    by_method = {}
    for method, build in _METHODS.items():
        found = [broadcast_schedule(adjacency, root, build(adjacency, root), prune=method != "all") for root in roots]
        sent = statistics.mean(len(schedule.turns) for schedule in found)
        by_method[method] = sent, statistics.mean(schedule.subslots for schedule in found)
    return Floods(
        hops=statistics.mean(max(levels(adjacency, root).values()) for root in roots),
        by_method=by_method,
        mpr=statistics.mean(mpr_transmissions(adjacency, root) for root in roots[:5]),
    )


def main() -> None:
    for name, make in (("grid", grid), ("uniform", uniform)):
        for count in (45, 200, 1000):
            adjacency = make(count)
            found = floods(adjacency, seed_of=count)
            degree = statistics.mean(len(near) for near in adjacency.values())
            print(f"{name} {len(adjacency)} of {count} UAVs, {degree:.1f} neighbors, {found.hops:.1f} hops deep")
            for method, (sent, subslots) in found.by_method.items():
                print(f"  {method:14} {sent:7.1f} transmissions {subslots:6.1f} sub-slots")
            print(f"  {'MPR (RFC 3626)':14} {found.mpr:7.1f} transmissions")


if __name__ == "__main__":
    main()
