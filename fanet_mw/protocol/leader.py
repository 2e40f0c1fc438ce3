"""The leader's part: collect positions from joins, divide the nodes into clusters, announce the schedule.

Joins come in bursts, so an assignment waits until no join has come for a moment; it is announced again once per
flooding period, for those who missed it. Each new assignment has a new epoch.
"""

from typing import Final

from fanet_mw.protocol.clustering import balanced
from fanet_mw.units import MS, US, Enu, NodeId
from fanet_mw.wire import CAPACITY, Member, Schedule

SETTLE_NS: Final = 700 * MS
"""Quiet time after the last join before the clusters are computed."""
_HEARD_NS: Final = 1500 * MS
"""An announcement has reached everyone after this."""


class Leader:
    """Computes schedules out of joins."""

    def __init__(self, *, node: NodeId, clusters: int, period_ns: int) -> None:
        self._node = node
        self._clusters = clusters
        self._period_ns = period_ns
        self._positions: dict[NodeId, Enu] = {}
        self._epoch = 0
        self._due_ns: int | None = None
        self._parts: list[Schedule] = []

    def joined(self, node: NodeId, position: Enu, *, now_ns: int) -> None:
        """A node said where it is. The leader itself is a member of no cluster (paper, 4.1)."""
        if node == self._node:
            return
        if node not in self._positions:
            self._due_ns = now_ns + SETTLE_NS
        self._positions[node] = position

    def next_wake_ns(self) -> int | None:
        return self._due_ns

    def wake(self, now_ns: int) -> list[Schedule]:
        """The schedule parts to announce now."""
        if self._due_ns is None or now_ns < self._due_ns:
            return []
        known = sum(len(part.members) for part in self._parts)
        if known != len(self._positions):
            self._assign(now_ns)
        self._due_ns = now_ns + self._period_ns
        return self._parts

    def _assign(self, now_ns: int) -> None:
        """A new epoch; its superframes begin when all should have heard of it."""
        start_ns = (now_ns + _HEARD_NS) // self._period_ns * self._period_ns + self._period_ns
        clusters = balanced(self._positions, count=self._clusters)
        self._epoch = (self._epoch + 1) & 0xFFFF
        members = [
            Member(node, index, node == cluster.head)
            for index, cluster in enumerate(clusters)
            for node in cluster.members
        ]
        chunks = [members[at : at + CAPACITY] for at in range(0, len(members), CAPACITY)]
        self._parts = [
            Schedule(
                start_us=start_ns // US,
                period_us=self._period_ns // US,
                slot_us=self._period_ns // len(clusters) // US,
                epoch=self._epoch,
                leader=self._node,
                clusters=len(clusters),
                part=part,
                parts=len(chunks),
                members=tuple(chunk),
            )
            for part, chunk in enumerate(chunks)
        ]

    def position(self, node: int) -> Enu:
        """Where a member last said to be."""
        return self._positions[NodeId(node)]

    @property
    def nodes_known(self) -> int:
        return len(self._positions)
