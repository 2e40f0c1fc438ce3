"""Affinity propagation (Frey & Dueck, Science 2007) among neighbors: nodes vote for exemplars, which become heads.

    r(i,k) <- s(i,k) - max over k' != k of a(i,k') + s(i,k')             responsibility: how well k serves i
    a(i,k) <- min(0, r(k,k) + sum over i' not in {i,k} of max(0, r(i',k)))   availability: how wanted k is
    a(k,k) <- sum over i' != k of max(0, r(i',k))

The similarity s(i,k) of neighbors is -(distance / range)^2. Only neighbors exchange messages, so each member hears its
head; two heads may hear each other. The preference s(k,k) sets how many heads there are: the greater, the more.
Messages are damped. Frey & Dueck add noise to break ties; here each preference is lowered by a millionth per rank of id
instead, so that the same inputs always give the same result. A node that has no exemplar for a neighbor after the last
round becomes one itself, the lowest ids first.
"""

import math
from typing import NamedTuple

from fanet_mw.routing.clustered.clustering.contract import Cluster, Promise, Swarm
from fanet_mw.units import NodeId

_Row = dict[NodeId, float]


class AffinityPropagation(NamedTuple):
    """The method and its parameters. `preference` is in units of -(range)^2; 0.5 is the median similarity in a uniform
    disk.
    """

    range_m: float
    preference: float = -0.5
    damping: float = 0.7
    rounds: int = 200
    settled: int = 15
    """The iteration stops when the exemplars have not changed for this many rounds."""

    @property
    def promise(self) -> Promise:
        return Promise(dominating=True, independent=False)

    def divide(self, swarm: Swarm) -> list[Cluster]:
        similarity = self._similarity(swarm)
        exemplars = self._propagate(similarity)
        return _gather(swarm, similarity, exemplars)

    def _similarity(self, swarm: Swarm) -> dict[NodeId, _Row]:
        rows: dict[NodeId, _Row] = {}
        for rank, node in enumerate(sorted(swarm.adjacency)):
            at = swarm.positions[node]
            rows[node] = {node: self.preference * (1 + rank * 1e-6)}
            for n in swarm.adjacency[node]:
                rows[node][n] = -math.pow(swarm.positions[n].minus(at).norm() / self.range_m, 2)
        return rows

    def _propagate(self, s: dict[NodeId, _Row]) -> frozenset[NodeId]:
        r: dict[NodeId, _Row] = {i: dict.fromkeys(row, 0.0) for i, row in s.items()}
        a: dict[NodeId, _Row] = {i: dict.fromkeys(row, 0.0) for i, row in s.items()}
        exemplars: frozenset[NodeId] = frozenset()
        unchanged = 0
        for _ in range(self.rounds):
            self._update_responsibility(s, r, a)
            self._update_availability(r, a)
            found = frozenset(k for k in s if r[k][k] + a[k][k] > 0)
            unchanged = unchanged + 1 if found == exemplars else 0
            exemplars = found
            if exemplars and unchanged >= self.settled:
                break
        return exemplars

    def _update_responsibility(self, s: dict[NodeId, _Row], r: dict[NodeId, _Row], a: dict[NodeId, _Row]) -> None:
        for i, row in s.items():
            totals = {k: a[i][k] + row[k] for k in row}
            first = max(totals, key=lambda k: (totals[k], -k))
            second = max((totals[k] for k in totals if k != first), default=-math.inf)
            for k in row:
                rival = second if k == first else totals[first]
                # a node without neighbors serves itself
                fresh = row[k] - rival if rival > -math.inf else 1.0
                r[i][k] = self.damping * r[i][k] + (1 - self.damping) * fresh

    def _update_availability(self, r: dict[NodeId, _Row], a: dict[NodeId, _Row]) -> None:
        for k in r:  # the rows are symmetric: k is a neighbor of exactly those nodes that are neighbors of k
            support = math.fsum(max(0.0, r[i][k]) for i in r[k] if i != k)
            for i in r[k]:
                fresh = support if i == k else min(0.0, r[k][k] + support - max(0.0, r[i][k]))
                a[i][k] = self.damping * a[i][k] + (1 - self.damping) * fresh


def _gather(swarm: Swarm, similarity: dict[NodeId, _Row], exemplars: frozenset[NodeId]) -> list[Cluster]:
    """Put each node into the cluster of the nearest exemplar that it hears; a node that hears none becomes one."""
    heads = set(exemplars)
    for node in sorted(similarity):
        if node not in heads and not any(n in heads for n in swarm.adjacency[node]):
            heads.add(node)
    members: dict[NodeId, list[NodeId]] = {head: [] for head in sorted(heads)}
    for node, row in similarity.items():
        near = [n for n in swarm.adjacency[node] if n in heads]
        members[node if node in heads else max(near, key=lambda n: (row[n], -n))].append(node)
    return [Cluster(head, tuple(sorted(found))) for head, found in members.items()]
