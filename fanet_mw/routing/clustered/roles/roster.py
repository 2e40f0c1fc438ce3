"""What the leader knows of the nodes of its swarm: where they fly by their joins, and which are said to be silent.

    join -> known, until it gives no sign of life for so long that two updates of its position have been lost
    a report that a node is silent -> some time to object -> no longer known

A node has objected when it has generated something since it was said to be silent.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from fanet_mw.motion import Motion
from fanet_mw.routing.clustered.roles.liveness import Liveness
from fanet_mw.units import Enu, NodeId, S

_MISSED_NS: Final = 4 * S
"""The time for which a node has about been silent when that is reported."""
_SURE: Final = 0.9
"""The share of the range within which a link is certain, because places are accurate to a tenth of the range."""


class _SilentNode(NamedTuple):
    """A node that was reported silent; if it is a head, the node that reports it serves its cluster meanwhile."""

    by: NodeId
    since_ns: int
    """The instant at which the leader learned of it."""
    reported_ns: int
    """The instant at which it was reported; a node that has generated something later is alive."""


class Roster:
    """The nodes that one leader knows, itself not among them."""

    def __init__(self, liveness: Liveness, *, lost_ns: int, objection_ns: int, sure_m: float | None) -> None:
        """A node is forgotten `lost_ns` after its last sign of life; reported silent it may object for `objection_ns`.

        `sure_m`: a report counts only of a node that was so near to its sender all the time that the two should have
        heard each other; None: wherever they were.
        """
        self._liveness = liveness
        self._lost_ns = lost_ns
        self._objection_ns = objection_ns
        self._sure_m = sure_m
        self._motions: dict[NodeId, Motion] = {}
        self._reports: dict[NodeId, _SilentNode] = {}

    def __contains__(self, node: NodeId) -> bool:
        return node in self._motions

    @property
    def nodes(self) -> list[NodeId]:
        """The nodes that are known, in the order of their first joins."""
        return list(self._motions)

    @property
    def stand_ins(self) -> Mapping[NodeId, NodeId]:
        """For each node that is said to be silent, by its id, the node that says so."""
        return {silent: self._reports[silent].by for silent in sorted(self._reports)}

    def is_news(self, node: NodeId, born_ns: int) -> bool:
        """True if nothing as new as this instant is known of a node."""
        known = self._motions.get(node)
        return known is None or known.at_ns < born_ns

    def on_join(self, node: NodeId, motion: Motion) -> None:
        """Note where a node was, and how it flew."""
        self._motions[node] = motion

    def on_report(self, silent: NodeId, by: NodeId, there: Motion, *, now_ns: int) -> int | None:
        """Note that a node is said to be silent by a node whose motion is given.

        Returned is the instant until which it may object; None if the report does not count.
        """
        if silent not in self._motions or not self._was_near(silent, there):
            return None
        known = self._reports.get(silent, _SilentNode(by, now_ns, there.at_ns))
        self._reports[silent] = known._replace(by=by)
        return known.since_ns + self._objection_ns

    def _was_near(self, node: NodeId, there: Motion) -> bool:
        """True if the two should have heard each other all the time; a node that has flown away is not silent."""
        if self._sure_m is None:
            return True
        known = self._motions[node]
        instants = (there.at_ns - _MISSED_NS, there.at_ns)
        return max(known.position_at(t_ns).minus(there.position_at(t_ns)).norm() for t_ns in instants) <= self._sure_m

    def forget(self, now_ns: int) -> None:
        """Forget nodes without a sign of life for long, and reported nodes that have not objected in time."""
        for node in sorted(self._motions):
            last_ns = max(self._liveness.last_ns(node) or 0, self._motions[node].at_ns)
            report = self._reports.get(node)
            if report is not None and last_ns > report.reported_ns:
                del self._reports[node]  # the node has objected
                report = None
            if now_ns - last_ns > self._lost_ns or (
                report is not None and now_ns >= report.since_ns + self._objection_ns
            ):
                del self._motions[node]

    def forget_reports(self) -> None:
        """Forget the reports of nodes that are no longer known, because an assignment without them has been made."""
        self._reports = {silent: report for silent, report in self._reports.items() if silent in self._motions}

    def places(self, t_ns: int) -> dict[NodeId, Enu]:
        """The places of the nodes at an instant if they fly on straight, by id."""
        return {node: self._motions[node].position_at(t_ns) for node in sorted(self._motions)}

    def velocities(self) -> Mapping[NodeId, Enu]:
        """The velocities of the nodes [m/s], by id."""
        return {node: self._motions[node].velocity for node in sorted(self._motions)}


def sure_m(range_m: float) -> float:
    """The distance within which a link between two nodes is certain."""
    return _SURE * range_m
