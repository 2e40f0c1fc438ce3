"""Random assessment delay: a packet is relayed unless enough copies come in time (Ni et al., MobiCom 1999, 3.2).

first copy -> wait -> fewer than `enough` copies received: relayed | as soon as there are enough: forgotten
"""

import heapq

from fanet_mw.node.duplicates import key_of
from fanet_mw.node.packet import Packet


class Assessment:
    """The packets of one node that are being assessed."""

    def __init__(self, *, enough: int) -> None:
        self._enough = enough
        self.pending: dict[int, tuple[int, Packet]] = {}
        """The packets by key, each with the number of copies received."""
        self._due: list[tuple[int, int]] = []

    def __len__(self) -> int:
        return len(self.pending)

    def first_copy(self, packet: Packet, *, due_ns: int) -> None:
        header = packet.header
        key = key_of(header.origin, header.seq)
        self.pending[key] = 1, packet
        heapq.heappush(self._due, (due_ns, key))

    def on_copy(self, key: int, *, now_ns: int) -> None:
        pending = self.pending.get(key)
        if pending is None:
            return
        copies, packet = pending
        if copies + 1 >= self._enough:
            del self.pending[key]
        else:
            self.pending[key] = copies + 1, packet

    def next_wake_ns(self) -> int | None:
        due, pending = self._due, self.pending
        while due and due[0][1] not in pending:
            heapq.heappop(due)  # it was decided already
        return due[0][0] if due else None

    def decided(self, *, now_ns: int) -> list[tuple[int, Packet]]:
        """The packets that too few other nodes have relayed, each with the instant at which its assessment ended."""
        relays, due = [], self._due
        while due and due[0][0] <= now_ns:
            due_ns, key = heapq.heappop(due)
            open_ = self.pending.pop(key, None)
            if open_ is not None:  # otherwise enough copies of it were received meanwhile
                relays.append((due_ns, open_[1]))
        return relays
