"""The neighbors of a node, each with its last hello. A neighbor expires when its hellos stop."""

from typing import Final, NamedTuple

from fanet_mw.units import NodeId, seconds_to_ns
from fanet_mw.wire.hello.beacon import Beacon

_LIFETIME_HELLOS: Final = 3.5
"""A neighbor expires after so many hello intervals without one (3 in OLSR: NEIGHB_HOLD_TIME, RFC 3626, 18.3)."""


def neighbor_lifetime_ns(hello_interval_s: float) -> int:
    """The time after a neighbor's last hello at which the neighbor, and what its hello said, is forgotten."""
    return int(_LIFETIME_HELLOS * seconds_to_ns(hello_interval_s))


class Neighbor(NamedTuple):
    """The last hello of one neighbor."""

    node: NodeId
    heard_ns: int
    rssi_dbm: float
    beacon: Beacon


class Neighbors:
    """The neighbors of one node."""

    def __init__(self, *, lifetime_ns: int) -> None:
        self._lifetime_ns = lifetime_ns
        self._by_id: dict[NodeId, Neighbor] = {}

    def on_hello(self, neighbor: Neighbor) -> None:
        self._by_id[neighbor.node] = neighbor

    def forget(self, node: NodeId) -> None:
        self._by_id.pop(node, None)

    def has(self, node: NodeId, *, now_ns: int) -> bool:
        neighbor = self._by_id.get(node)
        return neighbor is not None and neighbor.heard_ns >= now_ns - self._lifetime_ns

    def count(self, *, now_ns: int) -> int:
        horizon_ns = now_ns - self._lifetime_ns
        return sum(1 for neighbor in self._by_id.values() if neighbor.heard_ns >= horizon_ns)

    def alive(self, *, now_ns: int) -> list[Neighbor]:
        """The neighbors that have not expired, by id."""
        horizon_ns = now_ns - self._lifetime_ns
        return [self._by_id[node] for node in sorted(self._by_id) if self._by_id[node].heard_ns >= horizon_ns]
