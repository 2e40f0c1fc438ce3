"""Adapts clusters over time: heads stay as long as they can, and two heads that meet wait before one gives way.

Each step divides the swarm anew, with the present heads kept (least cluster change). Two heads that come into range of
each other have a truce for a time, because often they only pass each other (cluster contention interval, Basu et al.
2001). If they still hear each other when it ends, the one with the worse score steps down. With `patient`, such a head
stays as long as it has a member that hears no other head, because that member would become a head itself (new here).
When the swarm is divided anew, because clusters are too large or nodes have moved, is decided in `division.py`.
"""

from fanet_mw.routing.clustered.clustering.contract import Cluster, Swarm
from fanet_mw.routing.clustered.clustering.head_election import Elected, Pair, Score
from fanet_mw.units import NodeId


class Maintenance:
    """The clusters of one swarm over time."""

    def __init__(self, score: Score, *, keep: float, contention_ns: int, patient: bool = False) -> None:
        self._score = score
        self._keep = keep
        self._contention_ns = contention_ns
        self._patient = patient
        self._met_ns: dict[Pair, int] = {}
        self.clusters: list[Cluster] = []

    def step(self, swarm: Swarm, *, now_ns: int) -> list[Cluster]:
        """The clusters from now on; this method fills in `swarm.previous`."""
        members = {cluster.head: cluster.members for cluster in self.clusters if cluster.head in swarm.adjacency}
        meeting = [(a, b) for a in sorted(members) for b in swarm.adjacency[a] if b in members and a < b]
        self._met_ns = {pair: self._met_ns.get(pair, now_ns) for pair in meeting}
        truce = frozenset(
            pair
            for pair in meeting
            if now_ns - self._met_ns[pair] < self._contention_ns
            or (self._patient and self._needed(self._weaker(pair, swarm), members, swarm))
        )
        method = Elected(self._score, self._keep, truce)
        self.clusters = method.divide(swarm._replace(previous=self.clusters))
        return self.clusters

    def _weaker(self, pair: Pair, swarm: Swarm) -> NodeId:
        return max(pair, key=lambda n: (self._score(n, swarm), n))

    @staticmethod
    def _needed(head: NodeId, members: dict[NodeId, tuple[NodeId, ...]], swarm: Swarm) -> bool:
        """True if a member that still hears this head hears no other head."""
        mine = (n for n in members[head] if n in swarm.adjacency and head in swarm.adjacency[n])
        return any(not any(n in members and n != head for n in swarm.adjacency[member]) for member in mine)
