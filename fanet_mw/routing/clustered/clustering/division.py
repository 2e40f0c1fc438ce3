"""The leader's division of the nodes into clusters, and the decision when to divide anew. Pure functions.

The present clusters, less nodes that are gone and with new ones, are compared with a new division by cost, which is
taken if they cost `_WORSE` times as much. Heads, and their slots, are kept if they are nearly as good.
"""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, Self

from fanet_mw.errors import ConfigError, LocalProtocolError
from fanet_mw.extensions import make
from fanet_mw.graph.topology import Adjacency, levels
from fanet_mw.routing.clustered.clustering import Balanced, Cluster, Clustering, Promise, Swarm
from fanet_mw.routing.clustered.clustering.bisection import among
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.clusters import METHODS
from fanet_mw.units import NodeId

_WORSE: Final = 1.25
_LOYAL: Final = 1
"""A node whose cluster has come apart stays in it if the nearest head is at most so many hops nearer."""


class Division:
    """A clustering method (`clusters.method`), as one leader applies it."""

    def __init__(
        self, method: str, *, count: int, range_m: float, options: Mapping[str, Any] = MappingProxyType({})
    ) -> None:
        """A method that is not in this package comes from an extension, and is made with the same arguments."""
        self._method: Clustering = Balanced(count)
        self._count: int | None = count
        if method not in METHODS:
            made = make("clusters.method", method, count=count, range_m=range_m, options=options)
            self._method = _Foreign(method, made)
            self._count = None if self._method.promise.dominating else count

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """The division by a scenario's method, over links as long as its clusters or its radio have them."""
        clusters = scenario.clusters
        range_m = clusters.link_m or scenario.radio.range_m
        return cls(clusters.method, count=clusters.count, range_m=range_m, options=clusters.options)

    def divide(self, swarm: Swarm) -> list[Cluster]:
        return self._method.divide(swarm)

    def renew(self, present: Sequence[Cluster], swarm: Swarm, stand_ins: Mapping[NodeId, NodeId]) -> list[Cluster]:
        """The clusters from now on, in the order of their slots; the present ones if they are good enough."""
        kept = carried_on(present, swarm, stand_ins)
        fresh = self.divide(swarm._replace(previous=kept))
        if kept and self._keeps_promise(kept, len(fresh), swarm.adjacency):
            fair = math.ceil(len(swarm.adjacency) / len(kept)) if self._count else len(swarm.adjacency)
            if cost(kept, swarm.adjacency, fair=fair) <= _WORSE * cost(fresh, swarm.adjacency, fair=fair):
                return kept
        return in_their_slots(fresh, kept, swarm.adjacency)

    def _keeps_promise(self, kept: Sequence[Cluster], fresh: int, adjacency: Adjacency) -> bool:
        """True for as many clusters as asked for, or, if the method promises it, if members hear their heads."""
        if self._count is not None:
            return len(kept) == fresh
        return all(m == cluster.head or m in adjacency[cluster.head] for cluster in kept for m in cluster.members)


class _Foreign:
    """A clustering method of another package, whose clusters are checked: no node is left out, or led from outside."""

    def __init__(self, name: str, method: Clustering) -> None:
        self._name, self._method = name, method
        promise = getattr(method, "promise", None)
        if not isinstance(promise, Promise):
            raise ConfigError(f"clusters.method = {name!r}: promise = {promise!r} must be a Promise")
        self.promise = promise

    def divide(self, swarm: Swarm) -> list[Cluster]:
        told = self._method.divide(swarm)
        try:
            clusters = [Cluster(head, tuple(members)) for head, members in told]
            once = sorted(node for cluster in clusters for node in cluster.members) == sorted(swarm.positions)
        except (TypeError, ValueError):
            once, clusters = False, []
        if not once or any(cluster.head not in cluster.members for cluster in clusters):
            raise LocalProtocolError(
                f"clusters.method = {self._name!r}: divide() must give clusters with each of the nodes "
                f"{sorted(swarm.positions)} in one, and its head among them, not {' '.join(repr(told).split()):.120}"
            )
        return clusters


def cost(clusters: Sequence[Cluster], adjacency: Adjacency, *, fair: int) -> float:
    """Transmissions that bring each member's packet to its head, plus one per member above the fair share."""
    total = 0
    for cluster in clusters:
        total += _distance(cluster.head, cluster.members, adjacency) + max(0, len(cluster.members) - fair)
    return total


def _distance(head: NodeId, members: Sequence[NodeId], adjacency: Adjacency) -> int:
    """Hops from members to their heads, summed; one that cannot reach its head counts as many as there are nodes."""
    hops = levels(adjacency, head)
    return sum(hops.get(member, len(adjacency)) for member in members)


def carried_on(present: Sequence[Cluster], swarm: Swarm, stand_ins: Mapping[NodeId, NodeId]) -> list[Cluster]:
    """The present clusters without the nodes that are gone, and with those that are new. A node whose cluster has come
    apart stays unless another head is clearly nearer: in a formation a UAV flies to the cluster that it joins.
    """
    here = swarm.adjacency
    clusters, before = list[Cluster](), dict[NodeId, int]()
    for cluster in present:
        members = [node for node in cluster.members if node in here]
        if members:
            before |= dict.fromkeys(members, len(clusters))
            stand_in = stand_ins.get(cluster.head, cluster.head)
            head = next((node for node in (cluster.head, stand_in) if node in members), None)
            head = head or min((_distance(node, members, here), node) for node in members)[1]
            clusters.append(Cluster(head, tuple(sorted(levels(among(members, here), head)))))
    return _with_the_others(clusters, here, before) if clusters else []


def _with_the_others(clusters: list[Cluster], here: Adjacency, before: Mapping[NodeId, int]) -> list[Cluster]:
    """Each node that is left returns to its former cluster (`before`) if no head is more than `_LOYAL` hops nearer over
    any nodes; else it joins the one whose head is nearest over members, or over any nodes if it hears none.
    """
    members = [set(cluster.members) for cluster in clusters]
    hops = [levels(among(cluster.members, here), cluster.head) for cluster in clusters]
    left = sorted(set(here).difference(*members))
    everywhere = [levels(here, cluster.head) for cluster in clusters] if left else []
    for node in [node for node in left if node in before]:
        k, nearest = before[node], min(hops.get(node, len(here)) for hops in everywhere)
        if node in everywhere[k] and everywhere[k][node] <= nearest + _LOYAL:
            members[k].add(node)
            hops[k][node] = everywhere[k][node]
            left.remove(node)
    while left:
        over_members = [
            (min(hops[k][near] for near in here[node] if near in members[k]) + 1, len(members[k]), k, node)
            for node in left
            for k in range(len(clusters))
            if members[k].intersection(here[node])
        ]
        if over_members:
            far, _, k, node = min(over_members)
        else:
            node = left[0]
            far, _, k = min((everywhere[k].get(node, len(here)), len(members[k]), k) for k in range(len(clusters)))
        members[k].add(node)
        hops[k][node] = far
        left.remove(node)
    return [cluster._replace(members=tuple(sorted(m))) for cluster, m in zip(clusters, members, strict=True)]


def in_their_slots(fresh: Sequence[Cluster], kept: Sequence[Cluster], adjacency: Adjacency) -> list[Cluster]:
    """The new clusters, each in its head's former slot; a former head is kept if nearly as near to the members."""
    slot_of = {cluster.head: slot for slot, cluster in enumerate(kept)}
    slots: dict[int, Cluster] = {}
    rest = []
    for cluster in fresh:
        best = _distance(cluster.head, cluster.members, adjacency)
        held = [node for node in cluster.members if node in slot_of]
        near = [(_distance(node, cluster.members, adjacency), node) for node in held]
        hops, head = min(near, default=(len(adjacency) ** 2, cluster.head))
        chosen = cluster._replace(head=head) if hops <= _WORSE * best + 1 else cluster
        slot = slot_of.get(chosen.head, len(fresh))
        if slot < len(fresh):
            slots[slot] = chosen
        else:
            rest.append(chosen)
    return [slots[slot] if slot in slots else rest.pop(0) for slot in range(len(fresh))]


def drift(before: Adjacency, after: Adjacency) -> float:
    """The share of all links in either graph that only one of them has."""
    links = [{(a, b) for a, near in adjacency.items() for b in near if a < b} for adjacency in (before, after)]
    either = len(links[0] | links[1])
    return len(links[0] ^ links[1]) / either if either else 0.0
