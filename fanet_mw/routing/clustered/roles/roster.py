"""The nodes that the leader knows: their motions, from joins, and which of them are reported silent.

A node is where it was, flown on straight; a companion, whose velocity was the leader's, also moves as the leader has
strayed from straight flight since, so that a formation that turns keeps its shape; in a rigid formation it is where it
was beside the leader. A silent node is forgotten unless it objects within `objection_ns`: any packet that it has
generated after the report counts as its objection.
"""

import math
from collections import deque
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from fanet_mw.motion import Motion
from fanet_mw.routing.clustered.roles.failure_detectors import Liveness
from fanet_mw.units import MS, Enu, NodeId, S

NO_SILENCE: Final[Mapping[NodeId, int]] = MappingProxyType({})
_MISSED_NS: Final = 4 * S
"""About the time for which a node has been silent when it is reported."""
_ALONG_M_S: Final = 2.0
"""The difference of velocities up to which a node flies with the leader."""
_SAMPLE_NS: Final = 200 * MS
_FLOWN_NS: Final = 60 * S
_SURE: Final = 0.9
"""The share of the radio range within which two nodes certainly hear each other, given the accuracy of positions."""


class _SilentNode(NamedTuple):
    """A report that a node is silent; if it is a head, the reporting node serves its cluster meanwhile."""

    by: NodeId
    since_ns: int
    """The instant at which the leader received the report."""
    reported_ns: int
    """The instant at which the report was made; if the node has generated a packet after it, it is alive."""


def alike(one: Motion, other: Motion) -> bool:
    """True if two velocities are those of one formation."""
    (east, north, up), (their_east, their_north, their_up) = one.velocity, other.velocity
    return math.hypot(east - their_east, north - their_north, up - their_up) <= _ALONG_M_S


class OwnFlight:
    """Where the leader itself was in the last minute."""

    def __init__(self) -> None:
        self._flown: deque[Motion] = deque()

    def add(self, here: Motion) -> None:
        if not self._flown or here.at_ns >= self._flown[-1].at_ns + _SAMPLE_NS:
            self._flown.append(here)
        while self._flown[0].at_ns < here.at_ns - _FLOWN_NS:
            self._flown.popleft()

    def at(self, t_ns: int) -> Motion | None:
        """The motion at an instant of the last minute, or after it; None if it is not known."""
        if not self._flown or t_ns < self._flown[0].at_ns - _SAMPLE_NS:
            return None
        nearest = min(self._flown, key=lambda motion: abs(motion.at_ns - t_ns))
        return Motion(nearest.position_at(t_ns), nearest.velocity, t_ns)

    def turned_ns(self, then: Motion) -> int | None:
        """When the leader's velocity was first another one than it was then; None if it has flown straight."""
        return next((own.at_ns for own in self._flown if own.at_ns > then.at_ns and not alike(own, then)), None)


class _Joined(NamedTuple):
    """What the latest join of a node has stated."""

    motion: Motion
    beside: Motion | None
    """The leader's motion at that instant if its velocity was the same, or in a rigid formation; or None."""


class Roster:
    """The nodes that one leader knows; the leader itself is not among them."""

    def __init__(
        self,
        liveness: Liveness,
        *,
        lost_ns: int,
        objection_ns: int,
        sure_m: float | None,
        settled_ns: int,
        rigid: bool = False,
    ) -> None:
        """A node is forgotten `lost_ns` after its last sign of life, or `objection_ns` after it was reported silent, if
        it was always within `sure_m` of the reporting one (None: anyway). `settled_ns`: when all updates about one turn
        have come; `rigid`: no distance in the formation changes.
        """
        self.own = OwnFlight()
        self._settled_ns = settled_ns
        self._rigid = rigid
        self._liveness = liveness
        self._lost_ns = lost_ns
        self._objection_ns = objection_ns
        self._sure_m = sure_m
        self._joined: dict[NodeId, _Joined] = {}
        self._reports: dict[NodeId, _SilentNode] = {}

    def __contains__(self, node: NodeId) -> bool:
        return node in self._joined

    @property
    def nodes(self) -> list[NodeId]:
        """The known nodes, in the order of their first joins."""
        return list(self._joined)

    @property
    def stand_ins(self) -> Mapping[NodeId, NodeId]:
        """For each node that is reported silent, the node that reports it."""
        return {silent: self._reports[silent].by for silent in sorted(self._reports)}

    def is_news(self, node: NodeId, born_ns: int) -> bool:
        known = self._joined.get(node)
        return known is None or known.motion.at_ns < born_ns

    def on_join(self, node: NodeId, motion: Motion) -> None:
        beside = self.own.at(motion.at_ns)
        along = beside is not None and (self._rigid or alike(motion, beside))
        self._joined[node] = _Joined(motion, beside if along else None)

    def on_report(self, silent: NodeId, by: NodeId, there: Motion, *, now_ns: int) -> int | None:
        """`by`, at `there`, reports a silent node. Returns until when that may object; None if it does not count."""
        if silent not in self._joined or not self._was_near(silent, there):
            return None
        known = self._reports.get(silent, _SilentNode(by, now_ns, there.at_ns))
        self._reports[silent] = known._replace(by=by)
        return known.since_ns + self._objection_ns

    def _was_near(self, node: NodeId, there: Motion) -> bool:
        """True if the reported node was near all the time: one that has flown away is not silent."""
        if self._sure_m is None:
            return True
        known = self._joined[node].motion
        instants = (there.at_ns - _MISSED_NS, there.at_ns)
        return max(known.position_at(t_ns).minus(there.position_at(t_ns)).norm() for t_ns in instants) <= self._sure_m

    def forget(self, now_ns: int, *, lost_ns: Mapping[NodeId, int] = NO_SILENCE) -> None:
        """Forget nodes silent for two position updates, or less (`lost_ns`), and reported ones without an objection."""
        for node in sorted(self._joined):
            last_ns = max(self._liveness.last_ns(node) or 0, self._joined[node].motion.at_ns)
            report = self._reports.get(node)
            if report is not None and last_ns > report.reported_ns:
                del self._reports[node]  # the node has objected
                report = None
            if now_ns - last_ns > min(self._lost_ns, lost_ns.get(node, self._lost_ns)) or (
                report is not None and now_ns >= report.since_ns + self._objection_ns
            ):
                del self._joined[node]

    def forget_reports(self) -> None:
        self._reports = {silent: report for silent, report in self._reports.items() if silent in self._joined}

    def places(self, t_ns: int, *, now_ns: int) -> dict[NodeId, Enu]:
        """The positions of all nodes at an instant, if they fly on straight, or with the leader, by id."""
        here = self.own.at(now_ns)
        return {node: self._place(node, here, t_ns, now_ns) for node in sorted(self._joined)}

    def _place(self, node: NodeId, here: Motion | None, t_ns: int, now_ns: int) -> Enu:
        motion, beside = self._joined[node]
        straight = motion.position_at(t_ns)
        if beside is None or here is None:
            return straight
        if self._rigid:
            return here.position_at(t_ns).minus(beside.position.minus(motion.position))
        turned_ns = self.own.turned_ns(beside)
        if turned_ns is not None and now_ns - turned_ns > self._settled_ns:
            return straight
        if turned_ns is None and now_ns - motion.at_ns > self._settled_ns:
            return straight
        return straight.minus(beside.position_at(t_ns).minus(here.position_at(t_ns)))

    def is_turning(self, now_ns: int) -> bool:
        """True while it is not known which companions have turned with the leader."""
        companions = (beside for _, beside in self._joined.values() if beside is not None)
        turns_ns = (turned_ns for beside in companions if (turned_ns := self.own.turned_ns(beside)) is not None)
        return any(now_ns - turned_ns <= self._settled_ns for turned_ns in turns_ns)

    def velocities(self) -> Mapping[NodeId, Enu]:
        return {node: self._joined[node].motion.velocity for node in sorted(self._joined)}


def sure_m(range_m: float) -> float:
    return _SURE * range_m
