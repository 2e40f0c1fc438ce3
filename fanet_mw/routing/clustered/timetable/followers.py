"""Who keeps a timetable: a bound holds only if all nodes keep the same one.

A node that floods a packet in its turn shows that it has the timetable; who has nothing to send floods a join in its
turn once. So a timetable that came late somewhere is noticed everywhere within a superframe, by what is missing.
"""

from collections.abc import Iterable
from typing import Final

from fanet_mw.routing.clustered.roles.membership import Version
from fanet_mw.units import NodeId

_KEPT: Final = 4
"""The versions that a node remembers: that in force, and newer ones."""


class Followers:
    """The nodes that have shown that they keep each timetable, as one node knows it."""

    def __init__(self, node: NodeId) -> None:
        self._node = node
        self._known: dict[Version, set[NodeId]] = {}

    def follow(self, version: Version) -> None:
        """The node itself has the timetable of another version now."""
        self._known.setdefault(version, {self._node})
        while len(self._known) > _KEPT:
            del self._known[next(iter(self._known))]

    def hear(self, version: Version, root: NodeId) -> None:
        """A flood of a node was heard in its turn of a timetable."""
        if version in self._known:
            self._known[version].add(root)

    def have(self, version: Version, nodes: Iterable[NodeId]) -> bool:
        """True if all these nodes have shown that they keep the timetable of a version."""
        return self._known.get(version, set()).issuperset(nodes)
