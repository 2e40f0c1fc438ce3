"""How much each node of the swarm sends, as one node hears it: from the sequence numbers and births of data packets.

    marks, at least 2 s apart   ->  packets per second between them: mean + twice its standard error  ->  load
    too few marks               ->  as the scenario says
    nothing heard for long      ->  what the silence allows

A node numbers its data packets without gaps, so two packets that are received tell how many there were between them,
also of those that were lost, or that their origin dropped because its turns did not suffice. What a packet states may
be forged: more than the greatest load, or a birth in the future, is refused and counted.
"""

import math
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Final

from fanet_mw.units import MS, NodeId, S, seconds_to_ns
from fanet_mw.wire.loads import AS_EXPECTED, MOST_LOAD, PER_NS

_APART_NS: Final = 2 * S
"""The least time between two marks of a node."""
_KEPT: Final = 7
"""The marks that are kept of a node: those of 12 s, or of its last 7 packets if it sends less."""
_ENOUGH: Final = 3
"""With fewer marks, a node is taken to send as the scenario says."""
_ERRORS: Final = 2.0
"""So many standard errors are added to the mean."""
_QUIET_NS: Final = 10 * S
"""A node of which nothing new was heard for so long, and three times its interval, sends less than it did."""
_GROWN: Final = 1.2
"""A timetable is replaced when a node's load has grown by this factor and needs more turns,"""
_SHRUNK: Final = 0.75
"""or when all nodes together need at most this share of the turns that they have."""


class HeardLoads:
    """The loads of all nodes, as one node hears them."""

    def __init__(self, *, interval_s: float) -> None:
        """`interval_s`: that of the packets of a node that sends as the scenario says."""
        self._interval_s = interval_s
        self._marks: dict[int, list[tuple[int, int]]] = {}
        """Of each origin, the births [ns] and sequence numbers of some packets, oldest first."""
        self.refused = 0
        """The number of packets that state what cannot be."""

    def on_packet(self, origin: int, seq: int, *, born_ns: int, now_ns: int) -> None:
        """A data packet was received for the first time, or begins at this node."""
        if born_ns > now_ns + MS:
            self.refused += 1
            return
        marks = self._marks.setdefault(origin, [(born_ns, seq)])
        last_ns, last_seq = marks[-1]
        if born_ns - last_ns < _APART_NS:
            return
        if not 0 < (seq - last_seq) * PER_NS <= MOST_LOAD * (born_ns - last_ns):
            self.refused += 1
            marks[:] = [(born_ns, seq)]
            return
        marks.append((born_ns, seq))
        del marks[:-_KEPT]

    def load(self, node: int, *, now_ns: int) -> int:
        """The number of packets of a node in 100 s, rounded up; `AS_EXPECTED` if too little was heard."""
        marks = self._marks.get(node, ())
        if len(marks) < _ENOUGH:
            return AS_EXPECTED
        (first_ns, first), (last_ns, last) = marks[0], marks[-1]
        mean = (last - first) * PER_NS / (last_ns - first_ns)
        parts = [(b - a) * PER_NS / (to_ns - from_ns) for (from_ns, a), (to_ns, b) in pairwise(marks)]
        variance = math.fsum((part - mean) ** 2 for part in parts) / (len(parts) - 1)
        load = mean + _ERRORS * math.sqrt(variance / len(parts))
        if now_ns - last_ns > max(_QUIET_NS, 3 * PER_NS / mean):
            load = min(load, (last - first + 1) * PER_NS / (now_ns - first_ns))
        return max(1, min(MOST_LOAD, math.ceil(load - 1e-6)))

    def loads(self, nodes: Iterable[NodeId], *, now_ns: int) -> dict[NodeId, int]:
        """The loads of these nodes."""
        return {node: self.load(node, now_ns=now_ns) for node in nodes}

    def worth_a_change(self, before: Mapping[NodeId, int], now: Mapping[NodeId, int], *, period_ns: int) -> bool:
        """True if loads have changed so much that the timetable made for the earlier ones should be replaced;
        `period_ns`: the length of a superframe.
        """
        had, need = (
            {node: packets(load, within_ns=period_ns, interval_s=self._interval_s) for node, load in loads.items()}
            for loads in (before, now)
        )
        had_turns = {node: max(1, math.ceil(had.get(node, 0.0))) for node in need}
        turns = {node: max(1, math.ceil(each)) for node, each in need.items()}
        if any(need[node] > _GROWN * had.get(node, 0.0) and turns[node] > had_turns[node] for node in need):
            return True
        return sum(turns.values()) <= _SHRUNK * sum(had_turns.values()) and bool(before)


def packets(load: int, *, within_ns: int, interval_s: float) -> float:
    """The packets of a node with this load within a duration; `interval_s`: what the scenario says."""
    return within_ns / seconds_to_ns(interval_s) if load == AS_EXPECTED else load * within_ns / PER_NS
