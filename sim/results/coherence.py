"""How well a swarm hangs together at an instant, as a graph of who is within reach of whom."""

from typing import NamedTuple

import numpy as np

from sim.world.arrays import Flags


class Coherence(NamedTuple):
    """The graph of one instant."""

    connected: bool
    """True if everyone reaches everyone over hops; also without anybody."""
    diameter: int
    """The greatest number of hops on the shortest way between two; if it is in parts, the greatest within any part."""
    cut_vertices: int
    """The number of those whose loss alone would separate others that are connected."""

    @property
    def biconnected(self) -> bool:
        """True if it is in one piece, and remains so when any one of them is lost."""
        return self.connected and not self.cut_vertices


def coherence(near: Flags) -> Coherence:
    """The graph of these pairs, which are those within reach of each other; everyone is near itself."""
    reached: Flags = np.asarray(near)
    hops = 1 if len(near) > 1 and bool((near & ~np.eye(len(near), dtype=bool)).any()) else 0
    links = near.astype(np.float32)
    while True:
        further: Flags = np.asarray((reached.astype(np.float32) @ links) > 0)
        if (further == reached).all():
            break
        reached, hops = further, hops + 1
    return Coherence(bool(reached.all()), hops, _cut_vertices(near))


def _cut_vertices(near: Flags) -> int:
    """The number of cut vertices, by depth-first search (Hopcroft, Tarjan 1973), without recursion."""
    beside = [[other for other in np.flatnonzero(row).tolist() if other != node] for node, row in enumerate(near)]
    found: list[int | None] = [None] * len(beside)
    lowest = [0] * len(beside)
    cuts: set[int] = set()
    clock = 0
    for root in range(len(beside)):
        if found[root] is not None:
            continue
        found[root] = lowest[root] = clock
        clock += 1
        trees, way = 0, [(root, iter(beside[root]))]
        while way:
            node, rest = way[-1]
            for other in rest:
                seen = found[other]
                if seen is None:
                    found[other] = lowest[other] = clock
                    clock += 1
                    way.append((other, iter(beside[other])))
                    break
                lowest[node] = min(lowest[node], seen)
            else:
                way.pop()
                if not way:
                    continue
                parent = way[-1][0]
                lowest[parent] = min(lowest[parent], lowest[node])
                before = found[parent]
                assert before is not None, "it is on the way"
                if parent == root:
                    trees += 1
                elif lowest[node] >= before:
                    cuts.add(parent)
        if trees > 1:
            cuts.add(root)
    return len(cuts)
