"""Cluster heads by rank: the best node without a head becomes one, and takes its neighbors that have none (Gerla & Tsai
1995).

The heads are a maximal independent set, so each node is a head or hears one. The methods differ only in the score by
which nodes are ranked (lower is better; of equal scores the lower id):

    lowest-ID        Ephremides, Wieselthier & Baker 1987      the id
    highest degree   Gerla & Tsai 1995                         most neighbors
    WCA              Chatterjee, Das & Turgut 2002             w1 |d - d0| + w2 distances + w3 mobility + w4 energy used
    lasting degree   (new here)                                neighbors, by how long they will be in range

Hysteresis: the score of a present head is improved by `keep`. If `keep` is infinite, a head is deposed only by a
better head in range (least cluster change, Chiang et al. 1997); pairs of heads under `truce` may hear each other for
the time being. A member keeps its head as long as it hears it. The method `balanced`, the default, chooses heads in the
middle of equal parts instead (`bisection.py`). What happens when a head falls silent is in `roles/failover.py`.
"""

import math
from collections.abc import Callable, Collection, Mapping
from typing import Final, NamedTuple

from fanet_mw.graph.topology import Adjacency
from fanet_mw.routing.clustered.clustering.contract import Cluster, Promise, Swarm, heads_of
from fanet_mw.routing.clustered.clustering.link_lifetime import link_lifetime_s
from fanet_mw.units import NodeId

Score = Callable[[NodeId, Swarm], float]
Pair = tuple[NodeId, NodeId]
"""Two heads, the lower id first."""


def by_id(node: NodeId, swarm: Swarm) -> float:
    """The score of the method lowest-ID."""
    return float(node)


def by_degree(node: NodeId, swarm: Swarm) -> float:
    """The score of the method highest degree."""
    return -float(len(swarm.adjacency[node]))


class Weights(NamedTuple):
    """The combined weight of WCA. Distances are divided by `range_m`, so that all terms are of a similar size.

    The weights of the WCA paper are 0.7, 0.2, 0.05, 0.05. Its fourth term, the time spent as head, is replaced here by
    the energy used. `ideal_degree` is the number of members that a head can serve.
    """

    range_m: float
    ideal_degree: int = 10
    degree: float = 0.7
    distance: float = 0.2
    mobility: float = 0.05
    energy: float = 0.05

    def __call__(self, node: NodeId, swarm: Swarm) -> float:
        at = swarm.positions[node]
        neighbors = swarm.adjacency[node]
        distances_m = math.fsum(swarm.positions[n].minus(at).norm() for n in neighbors)
        return (
            self.degree * abs(len(neighbors) - self.ideal_degree)
            + self.distance * distances_m / self.range_m
            + self.mobility * swarm.mobility.get(node, 0.0)
            + self.energy * (1 - swarm.energy.get(node, 1.0))
        )


class LastingDegree(NamedTuple):
    """The number of neighbors that a head would keep: each counts by the part of the horizon for which it stays in
    range.
    """

    range_m: float
    horizon_s: float = 30.0

    def __call__(self, node: NodeId, swarm: Swarm) -> float:
        return -math.fsum(
            min(link_lifetime_s(swarm, node, n, range_m=self.range_m), self.horizon_s) / self.horizon_s
            for n in swarm.adjacency[node]
        )


class Elected(NamedTuple):
    """A method of this file: a score, and the improvement of a present head's score."""

    score: Score
    keep: float = 0.0
    truce: frozenset[Pair] = frozenset()

    @property
    def promise(self) -> Promise:
        return Promise(dominating=True, independent=not self.truce)

    def divide(self, swarm: Swarm) -> list[Cluster]:
        scores = {node: self.score(node, swarm) for node in sorted(swarm.adjacency)}
        present = frozenset(heads_of(swarm.previous))
        ranks = {node: (score - self.keep if node in present else score, score) for node, score in scores.items()}
        heads = _elect(swarm.adjacency, ranks, self.truce)
        return _gather(swarm, heads)


LOWEST_ID: Final = Elected(by_id)
HIGHEST_DEGREE: Final = Elected(by_degree)


def _elect(adjacency: Adjacency, ranks: Mapping[NodeId, tuple[float, float]], truce: Collection[Pair]) -> list[NodeId]:
    """The heads, the best first."""
    heads: dict[NodeId, None] = {}
    for node in sorted(adjacency, key=lambda n: (ranks[n], n)):
        heard = (n for n in adjacency[node] if n in heads)
        if all((min(node, head), max(node, head)) in truce for head in heard):
            heads[node] = None
    return list(heads)


def _gather(swarm: Swarm, heads: list[NodeId]) -> list[Cluster]:
    """Put each member into the cluster of the head that it had, or else of the best head that it hears."""
    before = {member: cluster.head for cluster in swarm.previous for member in cluster.members}
    place = {head: index for index, head in enumerate(heads)}
    members: dict[NodeId, list[NodeId]] = {head: [head] for head in heads}
    for node in sorted(swarm.adjacency):
        if node in place:
            continue
        heard = [n for n in swarm.adjacency[node] if n in place]
        assert heard, "a node that is no head was covered by one"
        mine = before.get(node)
        members[mine if mine in heard else min(heard, key=place.__getitem__)].append(node)
    return [Cluster(head, tuple(sorted(members[head]))) for head in sorted(heads)]
