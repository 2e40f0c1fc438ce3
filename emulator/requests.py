"""Transmit requests in the medium: how many each node has made, and which of them the kernel holds.

The medium reads and writes the lists here directly for each frame, because a call for each would take as long as the
kernel does. Only rare operations are methods.
"""

from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.bus.messages import TxRequest
from fanet_mw.units import NodeId

NUMBER_MASK: Final = 0xFFFF_FFFF
"""The numbers of requests have 32 bits, and begin again at 0."""
_LONGEST_GAP: Final = 1 << 20
"""The greatest gap in request numbers that counts as lost requests; a longer one is nonsense."""


class RequestNumbers:
    """Counts by the numbers of each node's requests how many it has made, and how many of them the bus has lost."""

    def __init__(self, stations: int) -> None:
        self.expected: list[int | None] = [None] * stations
        """The expected number of each node's next request; None before its first one."""
        self._first = [0] * stations
        """The number of the first request of each node since its numbers last began anew."""
        self._earlier = [0] * stations
        """The number of requests that each node had made before its numbers last began anew."""
        self._before = [0] * stations
        """The number of requests that each node had made before its process was restarted."""

    def made(self, station: int) -> int:
        """The number of requests that a node has made, including those that a gap in the numbers shows to be lost."""
        expected = self.expected[station]
        return 0 if expected is None else self._earlier[station] + ((expected - self._first[station]) & NUMBER_MASK)

    def lost_before(self, station: int, seq: int) -> int:
        """The number of requests that were lost before one with an unexpected number, which is about to be taken."""
        expected = self.expected[station]
        if expected is not None:
            gap = (seq - expected) & NUMBER_MASK
            if gap < _LONGEST_GAP:
                return gap
            self._earlier[station] = self.made(station)
            if seq == 0:  # the node was restarted
                self._before[station] = self._earlier[station]
        # else the emulator was restarted, or the first requests were lost; the run's ledger will show that
        self._first[station] = seq
        return 0

    @property
    def total(self) -> int:
        return sum(map(self.made, range(len(self.expected))))

    def report(self) -> dict[str, Mapping[str, int]]:
        return {
            str(station + 1): {"all": self.made(station), "before_restart": before}
            for station, before in enumerate(self._before)
        }


class FrameSlots:
    """The requests that the kernel holds, by frame slot."""

    def __init__(self, slots: int, nodes: Sequence[NodeId], *, most_held: int) -> None:
        """`most_held`: the greatest number of requests of one node that may be held at the same time."""
        self.nodes = list(nodes)
        self.requests: list[TxRequest | None] = [None] * slots
        self.sources = [self.nodes[0]] * slots
        self.free = list(range(slots - 1, -1, -1))
        self.held = [0] * len(self.nodes)
        self.most_held = most_held

    @property
    def in_flight(self) -> int:
        return len(self.requests) - len(self.free)

    def add(self, slots: int) -> None:
        assert not self.free, "slots are added when all are in use"
        before = len(self.requests)
        self.requests += [None] * slots
        self.sources += [self.nodes[0]] * slots
        self.free = list(range(before + slots - 1, before - 1, -1))
