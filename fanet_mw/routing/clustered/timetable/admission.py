"""Admission control: whether a node's delay bound meets the application's deadline, and which packets it may accept.

    a timetable is in force -> the least interval between packets at which the bound meets the deadline; a packet that
                               comes sooner after the one before is refused
                            -> if no interval meets it: DeadlineLost, once; DeadlineMet when a later timetable does
    no bound yet            -> nothing is said: the timetables of a swarm that is still joining have gaps

So a growing load cannot break the deadline of earlier packets. If no interval meets it, packets are accepted at the
rate that the turns can carry. This is `traffic.deadline_s`; deadlines of messages are for `agents/messenger.py`.
"""

from typing import Final

from fanet_mw.routing.clustered.timetable.own_bound import RootTurns
from fanet_mw.trace import DeadlineLost, DeadlineMet
from fanet_mw.units import US, NodeId

_TOLERANCE_NS: Final = 1 * US
"""The instants of generation are rounded to microseconds."""


class Admission:
    """The admission control of one node."""

    def __init__(self, node: NodeId, *, deadline_ns: int, interval_ns: int, expected_ns: int) -> None:
        self._node = node
        self._deadline_ns = deadline_ns
        self._interval_ns = interval_ns
        self._met: bool | None = None
        """True if the deadline is met by the last answer that was recorded; None before the first one."""
        self._least_ns = 0
        """The least interval between accepted packets by the present timetable; 0 without one."""
        self._next_ns: int | None = None
        """The instant from which the next packet is accepted; None before the first packet."""
        self._expected_after_ns = expected_ns
        """The time after its start at which the node should have a bound."""
        self._expected_ns: int | None = None
        """The same as an instant; None once there is an answer, or its absence was recorded."""

    def start(self, now_ns: int) -> None:
        """The node has started, and has no bound yet."""
        self._expected_ns = now_ns + self._expected_after_ns

    def next_wake_ns(self) -> int | None:
        """When to record that there is still no bound; None if that is done, or there was one."""
        return self._expected_ns

    def wake(self, now_ns: int) -> DeadlineLost | None:
        if self._expected_ns is None or now_ns < self._expected_ns:
            return None
        self._expected_ns, self._met = None, False
        return DeadlineLost(now_ns, self._node, 0, self._deadline_ns, self.interval_ns)

    @property
    def interval_ns(self) -> int:
        return max(self._interval_ns, self._least_ns)

    def follow(self, own: RootTurns | None, *, now_ns: int) -> DeadlineMet | DeadlineLost | None:
        """Take over a new timetable's bound, or None; returns a record if the answer has changed."""
        least_ns = None if own is None else least_interval_ns(own, deadline_ns=self._deadline_ns - _TOLERANCE_NS)
        self._least_ns = least_ns or (0 if own is None else carried_interval_ns(own))
        bound_ns = own and own.worst_ns(interval_ns=self.interval_ns)
        if own is None and self._expected_ns is not None and now_ns < self._expected_ns:
            return None  # a bound may still come
        self._expected_ns = None
        before, self._met = self._met, least_ns is not None
        if self._met == before:
            return None
        record = DeadlineMet if self._met else DeadlineLost
        return record(now_ns, self._node, bound_ns or 0, self._deadline_ns, self.interval_ns)

    def admit(self, born_ns: int) -> bool:
        """True if a packet generated now is accepted; False if it follows too closely on the last accepted one."""
        if self._next_ns is not None and born_ns < self._next_ns - _TOLERANCE_NS:
            return False
        start_ns = born_ns if self._next_ns is None else max(born_ns, self._next_ns)
        self._next_ns = start_ns + self._least_ns
        return True


def carried_interval_ns(own: RootTurns) -> int:
    """The shortest interval between packets that the turns can carry."""
    return -(-own.turns.period_ns // (own.together * len(own.roots)))


def least_interval_ns(own: RootTurns, *, deadline_ns: int) -> int | None:
    """The shortest interval at which all have each packet in time, or None: in a busy period, the packets of the q-th
    turn came at least (q - 1) `together` intervals after its start (`Turns.worst_ns`).
    """
    first_ns, *later_ns = (ns + own.around_ns for ns in own.turns.done_ns(own.roots, span=own.span))
    if first_ns > deadline_ns:
        return None
    needed = (-(-(ns - deadline_ns) // (count * own.together)) for count, ns in enumerate(later_ns, start=1))
    return max(carried_interval_ns(own), *needed, 0)
