"""Who keeps a timetable: a bound holds only while all nodes keep the same one, and are heard.

A node that begins a flood in its turn marks the packet (`FLAG_TURN`), or floods a join if it has nothing to send. By
what is missing, every node notices that the timetable came late somewhere, or that a node or a relay on its way fell
silent. A node that neighbors report silent promises nothing for a while.
"""

from collections.abc import Iterable
from typing import Final

from fanet_mw.routing.clustered.roles.membership import Version
from fanet_mw.units import NodeId, S

_KEPT: Final = 4
"""The versions that a node remembers: that in force, and newer ones."""
_DOUBTED_NS: Final = 15 * S
"""A node that its neighbors do not hear is reported again within this time, as long as the schedule names it."""


class Followers:
    """The nodes that have shown that they keep each timetable, as one node knows it."""

    def __init__(self, node: NodeId) -> None:
        self._node = node
        self._known: dict[Version, dict[NodeId, int]] = {}
        self._doubted_ns: int | None = None

    def follow(self, version: Version) -> None:
        self._known.setdefault(version, {})
        self._doubted_ns = None
        while len(self._known) > _KEPT:
            del self._known[next(iter(self._known))]

    def hear(self, version: Version, root: NodeId, *, now_ns: int) -> None:
        """A flood of a node was heard in its turn of a timetable."""
        if version in self._known:
            self._known[version][root] = now_ns

    def unheard(self, version: Version, nodes: Iterable[NodeId], *, since_ns: int) -> list[NodeId]:
        """Those of these nodes that were not heard in their turns of a version since an instant."""
        known = {self._node: since_ns} | self._known.get(version, {})
        return [node for node in nodes if node not in known or known[node] < since_ns]

    def doubt(self, node: NodeId, *, now_ns: int) -> None:
        """A neighbor has told all that it does not hear a node, or that this hears nobody: it has to show again that it
        keeps a timetable. If it is this one, it waits.
        """
        if node == self._node:
            self._doubted_ns = now_ns
        for known in self._known.values():
            known.pop(node, None)

    def have(self, version: Version, nodes: Iterable[NodeId], *, silent_ns: int, now_ns: int) -> bool:
        """True if all these nodes have shown within `silent_ns` that they keep a version."""
        if version not in self._known or (self._doubted_ns is not None and now_ns < self._doubted_ns + _DOUBTED_NS):
            return False
        known, leader = self._known[version], version.authority.leader
        return all(
            node == leader and leader in known for node in self.unheard(version, nodes, since_ns=now_ns - silent_ns)
        )
