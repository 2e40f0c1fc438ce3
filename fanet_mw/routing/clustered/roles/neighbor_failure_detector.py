"""Failure detector for neighbors. It is used with a timetable, where a failed relay cuts off all nodes behind it.

    no hello for 4 intervals, and no packet that the neighbor generated
        -> this node floods a join that reports it, unless another node has done so
        -> the neighbor objects and stays, or the leader makes a new timetable without it
    a hello that states that the neighbor hears nobody (`deafness.py`)
        -> the same at once

A neighbor that has flown away objects, too, and is not reported again until a hello of it is heard. Without an
objection it is reported again every 10 s for a minute, while no packets of it arrive; a node floods at most one report
in 5 s. Who has received nothing from all of its neighbors for so long is deaf or alone, and reports nobody.
"""

from collections.abc import Callable
from typing import Final

from fanet_mw.routing.clustered.roles.head_failure_detector import SILENT_HELLOS
from fanet_mw.routing.clustered.roles.liveness import Liveness
from fanet_mw.units import NodeId, S

_AGAIN_NS: Final = 10 * S
"""A neighbor that is still in the schedule after this time is reported again, because the report may have been lost."""
_LEAST_NS: Final = 5 * S
"""The shortest time between two reports of a node, because each is a flood."""
_FORGOTTEN_NS: Final = 60 * S


class NeighborFailureDetector:
    """Watches the neighbors of one node."""

    def __init__(self, liveness: Liveness, *, hello_ns: int) -> None:
        self._liveness = liveness
        self._silent_ns = int(SILENT_HELLOS * hello_ns)
        self._heard_ns: dict[NodeId, int] = {}
        self._reported_ns: dict[NodeId, int] = {}
        self._deaf: set[NodeId] = set()
        """The neighbors whose latest hello stated that they hear nobody."""
        self._next_ns = 0
        """The instant from which the node may report again."""

    def on_hello(self, node: NodeId, *, now_ns: int) -> None:
        self._heard_ns[node] = now_ns
        self._reported_ns.pop(node, None)
        self._deaf.discard(node)

    def on_deaf(self, node: NodeId, *, now_ns: int) -> None:
        """A hello of a node was heard that hears nobody."""
        self._heard_ns.setdefault(node, now_ns)
        self._deaf.add(node)

    def on_report(self, node: NodeId, *, now_ns: int) -> None:
        """Some node, perhaps this one, has reported a node to the leader as silent."""
        if node in self._heard_ns:
            self._reported_ns[node] = now_ns

    def _hears_nobody(self, now_ns: int) -> bool:
        """True if all of several neighbors are silent."""
        return len(self._heard_ns) > 1 and all(
            now_ns - max(heard_ns, self._liveness.last_ns(node) or 0) >= self._silent_ns
            for node, heard_ns in self._heard_ns.items()
        )

    def find_suspect(self, lists: Callable[[NodeId], bool], *, now_ns: int) -> NodeId | None:
        """The neighbor to report now, of several the one not reported for longest, or None. `lists` tells whether the
        schedule names a node; neighbors that no longer count are forgotten.
        """
        if self._hears_nobody(now_ns):
            return None
        for node in sorted(self._heard_ns, key=lambda node: (self._reported_ns.get(node, 0), node)):
            quiet_ns, deaf = now_ns - self._heard_ns[node], node in self._deaf
            if quiet_ns < self._silent_ns and not deaf:
                continue
            sign_ns, reported_ns = self._liveness.last_ns(node) or 0, self._reported_ns.get(node)
            objected = reported_ns is not None and sign_ns > reported_ns
            if objected or quiet_ns > _FORGOTTEN_NS or not lists(node):
                del self._heard_ns[node]
                self._reported_ns.pop(node, None)
                self._deaf.discard(node)
            elif (deaf or now_ns - sign_ns >= self._silent_ns) and (
                reported_ns is None or now_ns - reported_ns >= _AGAIN_NS
            ):
                if now_ns < self._next_ns:
                    return None
                self._next_ns = now_ns + _LEAST_NS
                return node
        return None
