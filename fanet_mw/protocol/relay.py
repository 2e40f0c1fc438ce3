"""Which flooded packets a node relays, and when it decides so.

`all`      each one, at once
`gossip`   each one with probability min(1, degree / neighbors)     (after GOSSIP1: Haas, Halpern, Li, ToN 14(3), 2006)
`counter`  after a random assessment delay, unless enough copies were heard by then    (Ni et al., MobiCom 1999, 3.2)

`counter` adapts to density by itself: in a thin swarm nobody hears enough copies to stay silent, in a crowd most do.
"""

import heapq
from collections.abc import Callable

from fanet_mw.protocol.seen import key_of
from fanet_mw.protocol.txqueue import Packet
from fanet_mw.scenario import Clusters
from fanet_mw.units import MS


class Relay:
    """One node's relay decisions."""

    def __init__(self, clusters: Clusters, random: Callable[[], float]) -> None:
        self._rule = clusters.relay
        self._degree = clusters.gossip_degree
        self._enough = clusters.counter
        self._assess_ns = round(clusters.assess_ms * MS)
        self._random = random
        self._pending: dict[int, tuple[int, Packet]] = {}
        """Copies heard and the packet, by key."""
        self._due: list[tuple[int, int]] = []

    def __len__(self) -> int:
        return len(self._pending)

    def first_copy(self, packet: Packet, *, neighbors: int, now_ns: int) -> bool:
        """Take in a new packet; True: relay it now."""
        if self._rule == "gossip":
            return self._random() * neighbors <= self._degree
        if self._rule == "counter":
            key = key_of(origin=packet.header.origin, seq=packet.header.seq)
            self._pending[key] = 1, packet
            heapq.heappush(self._due, (now_ns + int(self._random() * self._assess_ns), key))
            return False
        return True

    def another_copy(self, key: int) -> None:
        """Somebody else relayed it."""
        pending = self._pending.get(key)
        if pending is not None:
            if pending[0] + 1 >= self._enough:
                del self._pending[key]
            else:
                self._pending[key] = pending[0] + 1, pending[1]

    def next_wake_ns(self) -> int | None:
        while self._due and self._due[0][1] not in self._pending:
            heapq.heappop(self._due)  # decided meanwhile
        return self._due[0][0] if self._due else None

    def decided(self, *, now_ns: int) -> list[Packet]:
        """Packets whose assessment is over and that too few others relayed."""
        relays = []
        while (due_ns := self.next_wake_ns()) is not None and due_ns <= now_ns:
            _, key = heapq.heappop(self._due)
            relays.append(self._pending.pop(key)[1])
        return relays
