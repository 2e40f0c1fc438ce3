"""Positions of other nodes, by beacons and the location service; and the neighbor that a packet is handed to next."""

from typing import Final

from fanet_mw.routing.geographic.messages import MOST_FIXES, Fix
from fanet_mw.units import Enu, NodeId, S

HELLO_INTERVAL_NS: Final = 1 * S
NEIGHBOR_LIFETIME_NS: Final = 5 * HELLO_INTERVAL_NS // 2
"""One beacon may be lost, but not two in a row."""
MIN_PROGRESS_M: Final = 10.0
"""The least progress towards the destination for which a packet is handed over: several times the error of a fix."""
_FUTURE_US: Final = 1_000_000
"""A location from further in the future than this is not believed, because it would never be replaced."""


class LocationTable:
    """What one node knows of the locations of others."""

    def __init__(self) -> None:
        self._neighbors: dict[NodeId, tuple[Enu, int]] = {}
        """The position of each neighbor, and until when it holds."""
        self._fixes: dict[NodeId, Fix] = {}
        self._used: dict[NodeId, None] = {}
        """Destinations in the order of their last use."""

    def on_beacon(self, neighbor: NodeId, position: Enu, *, now_ns: int) -> None:
        self._neighbors[neighbor] = position, now_ns + NEIGHBOR_LIFETIME_NS

    def forget(self, neighbor: NodeId) -> None:
        self._neighbors.pop(neighbor, None)

    def learn(self, fix: Fix, *, now_us: int) -> None:
        """Take in a location; the latest of each node is kept."""
        node = NodeId(fix.node)
        known = self._fixes.get(node)
        if fix.t_us <= now_us + _FUTURE_US and (known is None or fix.t_us > known.t_us):
            self._fixes[node] = fix

    def fix(self, node: NodeId) -> Fix | None:
        return self._fixes.get(node)

    def use(self, destination: NodeId) -> None:
        """Note that a destination is in use, so that its location is worth passing on."""
        self._used.pop(destination, None)
        self._used[destination] = None
        while len(self._used) > MOST_FIXES:
            del self._used[next(iter(self._used))]

    def in_use(self) -> tuple[Fix, ...]:
        return tuple(self._fixes[node] for node in self._used if node in self._fixes)

    def next_hop(self, destination: NodeId, *, at: Enu, excluded: NodeId, now_ns: int) -> NodeId | None:
        """The destination, or the neighbor nearest to it if nearer than `at`; never the giver, `excluded`: two nodes
        that know different locations would pass the packet back and forth.
        """
        if destination in self._neighbors and self._neighbors[destination][1] > now_ns:
            return destination
        fix = self._fixes.get(destination)
        if fix is None:
            return None
        best, best_m = None, fix.position.minus(at).norm() - MIN_PROGRESS_M
        for node in sorted(self._neighbors):
            position, ends_ns = self._neighbors[node]
            left_m = fix.position.minus(position).norm()
            if ends_ns > now_ns and node != excluded and left_m < best_m:
                best, best_m = node, left_m
        return best

    def count(self, *, now_ns: int) -> int:
        return sum(1 for _, ends_ns in self._neighbors.values() if ends_ns > now_ns)
