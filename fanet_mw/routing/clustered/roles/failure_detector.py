"""Which neighbors have fallen silent, where that cuts others off: in a timetable a dead relay loses all behind it.

    no hello of a neighbor for 4 intervals, and nothing that it generated -> a join that says so, with the node's next
    hello, unless another node has said so -> the neighbor objects, and stays; or the leader plans without it

A neighbor that flew away looks the same to this node: then the neighbor objects, and is not reported again until its
hellos are heard again. Where its objection does not arrive it is reported again every 10 s, for a minute; where packets
of it still arrive, never. A report is a join, and a node floods one of those in 5 s at most. The number of nodes bounds
what is remembered.
"""

from collections.abc import Callable
from typing import Final

from fanet_mw.routing.clustered.roles.failover import SILENT_HELLOS
from fanet_mw.routing.clustered.roles.liveness import Liveness
from fanet_mw.units import NodeId, S

_AGAIN_NS: Final = 10 * S
"""A neighbor that is still in the schedule after this time is reported again: the report may not have arrived."""
_FORGOTTEN_NS: Final = 60 * S


class FailureDetector:
    """One node's watch over its neighbors."""

    def __init__(self, liveness: Liveness, *, hello_ns: int) -> None:
        self._liveness = liveness
        self._silent_ns = int(SILENT_HELLOS * hello_ns)
        self._heard_ns: dict[NodeId, int] = {}
        self._reported_ns: dict[NodeId, int] = {}

    def on_hello(self, node: NodeId, *, now_ns: int) -> None:
        """Note a neighbor's hello."""
        self._heard_ns[node] = now_ns
        self._reported_ns.pop(node, None)

    def on_report(self, node: NodeId, *, now_ns: int) -> None:
        """Note that a node, perhaps this one, has reported a node to the leader as silent."""
        if node in self._heard_ns:
            self._reported_ns[node] = now_ns

    def find_suspect(self, lists: Callable[[NodeId], bool], *, now_ns: int) -> NodeId | None:
        """Look for a neighbor that should be reported now, and forget those that no longer count.

        None if there is nobody to report. `lists` says whether the schedule names a node.
        """
        for node in sorted(self._heard_ns):
            quiet_ns = now_ns - self._heard_ns[node]
            if quiet_ns < self._silent_ns:
                continue
            sign_ns, reported_ns = self._liveness.last_ns(node) or 0, self._reported_ns.get(node)
            objected = reported_ns is not None and sign_ns > reported_ns
            if objected or quiet_ns > _FORGOTTEN_NS or not lists(node):
                del self._heard_ns[node]
                self._reported_ns.pop(node, None)
            elif now_ns - sign_ns >= self._silent_ns and (reported_ns is None or now_ns - reported_ns >= _AGAIN_NS):
                return node
        return None
