"""The neighbors of a node, each with its last hello; and how long each has sent nothing, and usually does.

A neighbor expires when its hellos stop.
"""

from typing import Final, NamedTuple

from fanet_mw.units import NodeId, S, seconds_to_ns
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


_HALF_NS: Final = 3 * S
"""After so long half of the longest silence is forgotten, however many frames come: after a burst a node says nothing
but hellos again.
"""
_MOST_NS: Final = 4 * S
"""A longer silence counts as this one, and so does the time before the first frame."""
_UNUSUAL: Final = 2.5
"""A silence is unusual if it is this many times as long as the longest one of late."""


class Silences:
    """The frames that one node hears, whatever is in them."""

    def __init__(self, *, count: int) -> None:
        self._heard_ns = [0] * (count + 1)
        """The instant of the last frame of each neighbor; 0: none."""
        self._longest_ns = [0.0] * (count + 1)
        """The longest silence of late between two frames of each neighbor."""

    def on_frame(self, src: int, now_ns: int) -> None:
        heard_ns = self._heard_ns
        if src < len(heard_ns):
            silence_ns = now_ns - heard_ns[src] if heard_ns[src] else _MOST_NS
            if silence_ns > _MOST_NS:
                silence_ns = _MOST_NS
            longest_ns = self._longest_ns[src] * 0.5 ** (silence_ns / _HALF_NS)
            heard_ns[src] = now_ns
            self._longest_ns[src] = silence_ns if silence_ns > longest_ns else longest_ns

    def is_unusual(self, node: NodeId, *, least_ns: int, now_ns: int) -> bool:
        """True if a node that was heard before has been silent for an unusually long time, `least_ns` at least."""
        heard_ns = self._heard_ns[node]
        return heard_ns > 0 and now_ns - heard_ns > max(least_ns, _UNUSUAL * self._longest_ns[node])
