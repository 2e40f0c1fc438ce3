"""Decides which statement of swarm time a node accepts while it has no time of its own.

    a neighbor states the time -> how many others state the same? -> enough, and more than contradict it -> accepted

The leader's statement of its own time is accepted at once. Any other needs a second neighbor that agrees, or some time
in which no more contradict it than agree. Not detected: a liar that is the only neighbor, and liars that outnumber the
honest neighbors (`clock_fit`).
"""

from typing import Final

from fanet_mw.timesync.clock_fit import Oscillator, Pair, alike
from fanet_mw.units import NodeId

_ENOUGH: Final = 2
"""The number of neighbors that must agree."""


class InitialSync:
    """The statements of neighbors while none has been accepted."""

    def __init__(self, oscillator: Oscillator, *, leader: NodeId, wait_ns: int, memory_ns: int) -> None:
        self._oscillator = oscillator
        self._leader = leader
        self._wait_ns = wait_ns
        """How long a single statement waits for a second one."""
        self._memory_ns = memory_ns
        """How long a statement counts."""
        self._stated: dict[NodeId, tuple[int, Pair]] = {}
        self._since_ns = 0
        """The instant since which there has always been a statement that counts."""

    def on_statement(self, src: NodeId, reference: int, pair: Pair, *, local_ns: int) -> bool:
        """A neighbor has stated the time; returns True if the node should follow this reference from now on."""
        horizon_ns = pair.local_ns - self._memory_ns
        self._stated = {node: stated for node, stated in self._stated.items() if stated[1].local_ns >= horizon_ns}
        if not self._stated:
            self._since_ns = local_ns
        self._stated[src] = reference, pair
        if src == reference == self._leader:
            return True
        statements = self._stated.values()
        agreeing = sum(of == reference and alike(other, pair, self._oscillator) for of, other in statements)
        contradicting = len(self._stated) - agreeing
        if local_ns - self._since_ns >= self._wait_ns:
            return agreeing >= contradicting
        return agreeing >= _ENOUGH and agreeing > contradicting
