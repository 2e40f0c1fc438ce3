"""Transmit requests as the medium keeps them: how many each node made, and which of them the kernel holds.

The medium reads and writes the lists here by itself at every frame, because a call for each would cost as much as the
kernel; what happens seldom is a method.
"""

from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.bus.messages import TxRequest
from fanet_mw.units import NodeId

NUMBER_MASK: Final = 0xFFFF_FFFF
"""The numbers of requests are those of 32 bits, and begin again at 0."""
_LONGEST_GAP: Final = 1 << 20
"""The greatest gap in request numbers that is taken for requests that were lost; a longer one is taken for nonsense."""


class RequestNumbers:
    """What the numbers of each node's requests tell: how many it made, and how many of them the bus has lost."""

    def __init__(self, stations: int) -> None:
        self.expected: list[int | None] = [None] * stations
        """The number that the next request of each node should have; None before its first request."""
        self.made = [0] * stations
        """The number of requests that each node has made, with those that a gap in its numbers shows to be lost."""
        self._before = [0] * stations
        """The number of requests that each node had made before its process was restarted."""

    def lost_before(self, station: int, seq: int) -> int:
        """Count the requests that the bus has lost before one that has not the expected number; returns how many."""
        expected = self.expected[station]
        if expected is None:  # the emulator has restarted, or the first requests were lost: the run's ledger finds that
            return 0
        if seq == 0:  # the node has been restarted
            self._before[station] = self.made[station]
            return 0
        gap = (seq - expected) & NUMBER_MASK
        if gap >= _LONGEST_GAP:
            return 0
        self.made[station] += gap
        return gap

    @property
    def total(self) -> int:
        """The number of requests that all nodes have made."""
        return sum(self.made)

    def report(self) -> dict[str, Mapping[str, int]]:
        """The requests of each node, by its id."""
        return {
            str(node): {"all": made, "before_restart": before}
            for node, (made, before) in enumerate(zip(self.made, self._before, strict=True), start=1)
        }


class FrameSlots:
    """The requests that the kernel holds, by frame slot."""

    def __init__(self, slots: int, nodes: Sequence[NodeId], *, most_held: int) -> None:
        """`most_held`: how many requests of one node may be held at the same time."""
        self.nodes = list(nodes)
        """The node of each station."""
        self.requests: list[TxRequest | None] = [None] * slots
        self.sources = [self.nodes[0]] * slots
        """The sender of the request in each slot."""
        self.free = list(range(slots - 1, -1, -1))
        """The slots without a request; the last one is used first."""
        self.held = [0] * len(self.nodes)
        """The number of requests of each station that have not ended."""
        self.most_held = most_held

    @property
    def in_flight(self) -> int:
        """The number of requests that have not ended."""
        return len(self.requests) - len(self.free)

    def add(self, slots: int) -> None:
        """Add this many free slots, when none is free."""
        assert not self.free, "slots are added when all are in use"
        before = len(self.requests)
        self.requests += [None] * slots
        self.sources += [self.nodes[0]] * slots
        self.free = list(range(before + slots - 1, before - 1, -1))
