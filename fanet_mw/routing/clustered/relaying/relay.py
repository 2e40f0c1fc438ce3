"""Which flooded packets a node relays, and when it decides so.

`all`      each one, at once
`gossip`   each one with probability min(1, degree / neighbors)     (after GOSSIP1: Haas, Halpern, Li, ToN 14(3), 2006)
`counter`  after a random assessment delay, unless enough copies were heard by then    (Ni et al., MobiCom 1999, 3.2)

`counter` adapts to density by itself: in a thin swarm nobody hears enough copies to stay silent, in a crowd most do.
"""

from collections.abc import Callable

from fanet_mw.node.neighbors import Neighbors
from fanet_mw.node.queue import Packet
from fanet_mw.routing.assessment import Assessment
from fanet_mw.scenario import Clusters
from fanet_mw.units import MS


class Relay:
    """One node's relay decisions."""

    def __init__(self, clusters: Clusters, random: Callable[[], float]) -> None:
        self._rule = clusters.relay
        self._degree = clusters.gossip_degree
        self._assess_ns = round(clusters.assess_ms * MS)
        self._random = random
        self.assessment = Assessment(enough=clusters.counter)
        """Of `counter`; empty with other rules."""

    def first_copy(self, packet: Packet, neighbors: Neighbors, *, now_ns: int) -> bool:
        """Take in a new packet; True: relay it now."""
        if self._rule == "gossip":
            return self._random() * neighbors.count(now_ns=now_ns) <= self._degree
        if self._rule == "counter":
            self.assessment.first_copy(packet, due_ns=now_ns + int(self._random() * self._assess_ns))
            return False
        return True
