"""Does a node's own bound meet the application's deadline, and which packets may it therefore let in?

    timetable in force  ->  least interval at which the bound meets the deadline: packets that come sooner are refused
                        ->  none does, or there is no bound: DeadlineLost, once; later perhaps DeadlineMet
    no bound yet        ->  nothing is said until there should be one: timetables of a swarm that is still joining have
                            gaps, and say nothing of the one to come

Packets that are let in are at least that interval apart, which is what the bound (`Turns.worst_ns`) assumes, so load
that grows cannot break the deadline of those before it. Where no interval meets the deadline the application is told,
and goes on at the rate that the turns carry: late is better than never. More urgent packets are not policed.
"""

from typing import Final

from fanet_mw.routing.clustered.tdma.own_bound import OwnBound
from fanet_mw.trace import DeadlineLost, DeadlineMet
from fanet_mw.units import US, NodeId

_TOLERANCE_NS: Final = 1 * US
"""Packets are generated at whole microseconds."""


class Admission:
    """One node's admission of packets of its own."""

    def __init__(self, node: NodeId, *, deadline_ns: int, interval_ns: int, expected_ns: int) -> None:
        self._node = node
        self._deadline_ns = deadline_ns
        self._interval_ns = interval_ns
        """The interval at which the application says it sends."""
        self._met: bool | None = None
        self._least_ns = 0
        self._next_ns: int | None = None
        self._expected_after_ns = expected_ns
        """The time after its start at which a node should have a bound."""
        self._expected_ns: int | None = None

    def start(self, now_ns: int) -> None:
        """The node is up; it has no bound yet."""
        self._expected_ns = now_ns + self._expected_after_ns

    def next_wake_ns(self) -> int | None:
        """The instant at which to record that there still is no bound; None: it is recorded, or there was one."""
        return self._expected_ns

    def wake(self, now_ns: int) -> DeadlineLost | None:
        """What is to be said now."""
        if self._expected_ns is None or now_ns < self._expected_ns:
            return None
        self._expected_ns, self._met = None, False
        return DeadlineLost(now_ns, self._node, 0, self._deadline_ns, self.interval_ns)

    @property
    def interval_ns(self) -> int:
        """No two packets that are let in are closer."""
        return max(self._interval_ns, self._least_ns)

    def follow(self, own: OwnBound | None, *, now_ns: int) -> DeadlineMet | DeadlineLost | None:
        """Take up the bound of a new timetable; None: it has none for the node. Returns what is new of the deadline."""
        least_ns = None if own is None else least_interval_ns(own, deadline_ns=self._deadline_ns - _TOLERANCE_NS)
        self._least_ns = least_ns or (0 if own is None else carried_interval_ns(own))
        bound_ns = own and own.worst_ns(interval_ns=self.interval_ns)
        if own is None and self._expected_ns is not None and now_ns < self._expected_ns:
            return None  # it may still come
        self._expected_ns = None
        before, self._met = self._met, least_ns is not None
        if self._met == before:
            return None
        record = DeadlineMet if self._met else DeadlineLost
        return record(now_ns, self._node, bound_ns or 0, self._deadline_ns, self.interval_ns)

    def admit(self, born_ns: int) -> bool:
        """Let in a packet generated at this instant, if it keeps the interval; False if it is refused."""
        if self._next_ns is not None and born_ns < self._next_ns - _TOLERANCE_NS:
            return False
        start_ns = born_ns if self._next_ns is None else max(born_ns, self._next_ns)
        self._next_ns = start_ns + self._least_ns
        return True


def carried_interval_ns(own: OwnBound) -> int:
    """The shortest interval at which no more packets come than are let out."""
    return -(-own.turns.period_ns // (own.together * len(own.roots)))


def least_interval_ns(own: OwnBound, *, deadline_ns: int) -> int | None:
    """The shortest interval at which no packet takes longer than this to everyone; None: there is none.

    Of a busy period, what the q-th turn lets out has come (q - 1) `together` intervals later (`Turns.worst_ns`).
    """
    first_ns, *later_ns = (ns + own.around_ns for ns in own.turns.done_ns(own.roots, span=own.span))
    if first_ns > deadline_ns:
        return None
    needed = (-(-(ns - deadline_ns) // (count * own.together)) for count, ns in enumerate(later_ns, start=1))
    return max(carried_interval_ns(own), *needed, 0)
