"""Rules by which a node decides alone whether it passes a flooded packet on.

`all`      each one, at once
`gossip`   each one with probability min(1, degree / neighbors)     (after GOSSIP1: Haas, Halpern, Li, ToN 14(3), 2006)
`counter`  after a random assessment delay, unless enough copies were heard by then    (Ni et al., MobiCom 1999, 3.2)

`counter` adapts to density by itself: in a thin swarm no node hears enough copies to stay silent, in a crowd most do.
"""

from collections.abc import Callable
from typing import Protocol

from fanet_mw.node.neighbors import Neighbors
from fanet_mw.node.packet import Packet
from fanet_mw.routing.assessment import Assessment
from fanet_mw.scenario import Clusters
from fanet_mw.units import MS


class Rule(Protocol):
    """One node's decisions; `open_until` is empty for a rule that decides at once."""

    open_until: Assessment
    """Packets whose relay is still open."""

    def relays_now(self, packet: Packet, *, now_ns: int) -> bool:
        """Take in a new packet; True: it is relayed now. False: it is not, or not yet."""


class RelayAll:
    """Every packet is relayed."""

    def __init__(self) -> None:
        self.open_until = Assessment(enough=1)

    def relays_now(self, packet: Packet, *, now_ns: int) -> bool:
        return True


class GossipRule:
    """A packet is relayed with a probability that the number of neighbors decides."""

    def __init__(self, clusters: Clusters, neighbors: Neighbors, random: Callable[[], float]) -> None:
        self.open_until = Assessment(enough=1)
        self._degree = clusters.gossip_degree
        self._neighbors = neighbors
        self._random = random

    def relays_now(self, packet: Packet, *, now_ns: int) -> bool:
        return self._random() * self._neighbors.count(now_ns=now_ns) <= self._degree


class CounterRule:
    """A packet is relayed after a while, unless enough others have relayed it by then."""

    def __init__(self, clusters: Clusters, random: Callable[[], float]) -> None:
        self.open_until = Assessment(enough=clusters.counter)
        self._assess_ns = round(clusters.assess_ms * MS)
        self._random = random

    def relays_now(self, packet: Packet, *, now_ns: int) -> bool:
        self.open_until.first_copy(packet, due_ns=now_ns + int(self._random() * self._assess_ns))
        return False
