"""Estimates how many packets each node of the swarm sends, from the sequence numbers and birth times of those that one
node receives.

Two received packets tell how many the origin has made between them, lost and dropped ones included. Some of each node,
at least 1 s apart, are kept as marks:

    enough marks                the mean rate between the marks, plus twice its standard error
    nothing heard for long      at most the mean rate from the first mark until now, with one packet in the silence
    too few marks               the load that the scenario states; the least load if none of its traffic is the node's

A packet born in the future, or that implies more than the greatest load, may be forged: it is counted only.
"""

import math
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Final

from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, NodeId, S, seconds_to_ns
from fanet_mw.wire.loads import AS_EXPECTED, LEAST_LOAD, MOST_LOAD, PER_NS

_APART_NS: Final = 1 * S
"""The least time between two marks of a node."""
_KEPT: Final = 13
"""The greatest number of marks that are kept of a node. That many span at least 12 s."""
_ENOUGH: Final = 4
"""With fewer marks, a node is assumed to send as the scenario states."""
_ERRORS: Final = 2.0
"""The number of standard errors that are added to the mean rate."""
_QUIET_NS: Final = 10 * S
"""A node is taken to send less than before if it was not heard for this time and for three of its packet intervals. A
packet that is heard late because it has waited for turns ends such a silence too."""
_SETTLE_NS: Final = 3 * S
"""The time for which loads must ask for another timetable before it is made, because nodes that begin to send more at
the same time are not all heard at the same time."""
_GROWN: Final = 1.2
"""A timetable is replaced if the load of a node has grown by more than this factor and needs more turns."""
_SHRUNK: Final = 0.75
"""A timetable is also replaced if all nodes together need at most this share of the turns that they have."""


class HeardLoads:
    """The loads of all nodes, as one node estimates them."""

    def __init__(self, *, interval_s: float, stated: Mapping[NodeId, int]) -> None:
        """`interval_s`: the packet interval that the scenario states; `stated`: see `stated_loads`."""
        self._interval_s = interval_s
        self._stated = stated
        self._marks: dict[int, list[tuple[int, int]]] = {}
        """Of each origin, the births [ns] and sequence numbers of some packets, oldest first."""
        self._heard_ns: dict[int, int] = {}
        self._asked_ns: int | None = None
        """The instant since which loads have asked for another timetable; None if they do not."""
        self.refused = 0
        """The number of packets that were not used because their fields are impossible."""

    def on_packet(self, origin: int, seq: int, *, born_ns: int, now_ns: int) -> None:
        """Called for each data packet that is received for the first time or made by this node."""
        if born_ns > now_ns + MS:
            self.refused += 1
            return
        self._heard_ns[origin] = now_ns
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

    def load(self, node: NodeId, *, now_ns: int) -> int:
        """The number of packets that a node sends in 100 s, rounded up; what is stated with too few marks."""
        marks = self._marks.get(node, ())
        if len(marks) < _ENOUGH:
            return self._stated.get(node, AS_EXPECTED)
        (first_ns, first), (last_ns, last) = marks[0], marks[-1]
        mean = (last - first) * PER_NS / (last_ns - first_ns)
        parts = [(b - a) * PER_NS / (to_ns - from_ns) for (from_ns, a), (to_ns, b) in pairwise(marks)]
        variance = math.fsum((part - mean) ** 2 for part in parts) / (len(parts) - 1)
        load = mean + _ERRORS * math.sqrt(variance / len(parts))
        if now_ns - self._heard_ns[node] > max(_QUIET_NS, 3 * PER_NS / mean):
            load = min(load, (last - first + 1) * PER_NS / (now_ns - first_ns))
        return max(LEAST_LOAD, min(MOST_LOAD, math.ceil(load - 1e-6)))

    def loads(self, nodes: Iterable[NodeId], *, now_ns: int) -> dict[NodeId, int]:
        return {node: self.load(node, now_ns=now_ns) for node in nodes}

    def worth_a_change(
        self, before: Mapping[NodeId, int], now: Mapping[NodeId, int], *, period_ns: int, now_ns: int
    ) -> bool:
        """True if loads have long differed enough from `before` to replace its timetable; `period_ns`: a superframe."""
        if not self._differ(before, now, period_ns):
            self._asked_ns = None
            return False
        self._asked_ns = now_ns if self._asked_ns is None else self._asked_ns
        return now_ns - self._asked_ns >= _SETTLE_NS

    def _differ(self, before: Mapping[NodeId, int], now: Mapping[NodeId, int], period_ns: int) -> bool:
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
    """Packets of a node with this load within a duration; `interval_s` applies if the load is `AS_EXPECTED`."""
    return within_ns / seconds_to_ns(interval_s) if load == AS_EXPECTED else load * within_ns / PER_NS


def stated_loads(scenario: Scenario) -> Mapping[NodeId, int]:
    """The least load for each node without traffic in the scenario, all of whose classes name other sources."""
    named: set[int] = set()
    for traffic in scenario.traffic_classes.values():
        if traffic.arrivals == "none":
            continue
        if not isinstance(traffic.sources, tuple):
            return {}
        named.update(traffic.sources)
    nodes = range(1, scenario.node_count + 1) if named else ()
    return {NodeId(node): LEAST_LOAD for node in nodes if node not in named}
