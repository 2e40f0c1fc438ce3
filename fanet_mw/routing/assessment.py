"""Packets under random assessment: relayed unless enough copies are heard meanwhile (Ni et al., MobiCom 1999, 3.2).

first copy -> wait -> fewer than `enough` copies heard: it is relayed | enough copies heard: it is forgotten
"""

import heapq

from fanet_mw.node.duplicates import key_of
from fanet_mw.node.packet import Packet


class Assessment:
    """The packets of one node that wait for further copies."""

    def __init__(self, *, enough: int) -> None:
        self._enough = enough
        self._pending: dict[int, tuple[int, Packet]] = {}
        """The number of copies heard and the packet, by key."""
        self._due: list[tuple[int, int]] = []

    def __len__(self) -> int:
        return len(self._pending)

    def first_copy(self, packet: Packet, *, due_ns: int) -> None:
        """Assess a new packet until `due_ns`."""
        key = key_of(origin=packet.header.origin, seq=packet.header.seq)
        self._pending[key] = 1, packet
        heapq.heappush(self._due, (due_ns, key))

    def on_copy(self, key: int, *, now_ns: int) -> None:
        """Count a copy that another node has relayed."""
        pending = self._pending.get(key)
        if pending is None:
            return
        copies, packet = pending
        if copies + 1 >= self._enough:
            del self._pending[key]
        else:
            self._pending[key] = copies + 1, packet

    def next_wake_ns(self) -> int | None:
        while self._due and self._due[0][1] not in self._pending:
            heapq.heappop(self._due)  # this packet was decided meanwhile
        return self._due[0][0] if self._due else None

    def decided(self, *, now_ns: int) -> list[Packet]:
        """The packets whose assessment is over and that too few other nodes have relayed."""
        relays = []
        while (due_ns := self.next_wake_ns()) is not None and due_ns <= now_ns:
            _, key = heapq.heappop(self._due)
            relays.append(self._pending.pop(key)[1])
        return relays
