"""Transmit requests as the medium keeps them: how many each node made, and which of them the kernel holds."""

from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.bus.messages import TxRequest
from fanet_mw.units import NodeId

_MASK: Final = 0xFFFF_FFFF
_LONGEST_GAP: Final = 1 << 20
"""The greatest gap in request numbers that is taken for requests that were lost; a longer one is taken for nonsense."""


class RequestNumbers:
    """What the numbers of each node's requests tell: how many it made, and how many of them the bus has lost."""

    def __init__(self, stations: int) -> None:
        self._next: list[int | None] = [None] * stations
        self._made = [0] * stations
        """The number of requests that each node has made, with those that a gap in its numbers shows to be lost."""
        self._before = [0] * stations
        """The number of requests that each node had made before its process was restarted."""

    def take_in(self, station: int, seq: int) -> int:
        """Count a request of this number; returns how many requests before it the bus has lost."""
        lost = 0 if seq == self._next[station] else self._gap(station, seq)
        self._next[station] = (seq + 1) & _MASK
        self._made[station] += 1 + lost
        return lost

    def _gap(self, station: int, seq: int) -> int:
        expected = self._next[station]
        if expected is None:  # the emulator has restarted, or the first requests were lost: the run's ledger finds that
            return 0
        if seq == 0:  # the node has been restarted
            self._before[station] = self._made[station]
            return 0
        gap = (seq - expected) & _MASK
        return gap if gap < _LONGEST_GAP else 0

    def report(self) -> dict[str, Mapping[str, int]]:
        """The requests of each node, by its id."""
        return {
            str(node): {"all": made, "before_restart": before}
            for node, (made, before) in enumerate(zip(self._made, self._before, strict=True), start=1)
        }


class FrameSlots:
    """The requests that the kernel holds, by frame slot."""

    def __init__(self, slots: int, nodes: Sequence[NodeId], *, most_held: int) -> None:
        """`most_held`: how many requests of one node may be held at the same time."""
        self._nodes = list(nodes)
        self.requests: list[TxRequest | None] = [None] * slots
        self.sources = [self._nodes[0]] * slots
        """The sender of the request in each slot."""
        self.free = list(range(slots - 1, -1, -1))
        """The slots without a request; the last one is used first."""
        self.held = [0] * len(self._nodes)
        """The number of requests of each station that have not ended."""
        self.most_held = most_held

    @property
    def in_flight(self) -> int:
        """The number of requests that have not ended."""
        return len(self.requests) - len(self.free)

    def take(self, station: int, request: TxRequest) -> int:
        """Put a request into a free slot; returns that slot."""
        slot = self.free.pop()
        self.held[station] += 1
        self.requests[slot] = request
        self.sources[slot] = self._nodes[station]
        return slot

    def release(self, slot: int, station: int) -> None:
        """The request in this slot has ended; it was made by this station."""
        self.requests[slot] = None
        self.held[station] -= 1
        self.free.append(slot)

    def add(self, slots: int) -> None:
        """Add this many free slots, when none is free."""
        assert not self.free, "slots are added when all are in use"
        before = len(self.requests)
        self.requests += [None] * slots
        self.sources += [self._nodes[0]] * slots
        self.free = list(range(before + slots - 1, before - 1, -1))
