"""Units and identities. Instants and durations are `int` nanoseconds; positions are ENU metres."""

import math
from typing import Final, NamedTuple, NewType

US: Final = 1_000
MS: Final = 1_000_000
S: Final = 1_000_000_000

NodeId = NewType("NodeId", int)
"""The id of a node: 1 to the number of nodes, and its MAVLink system id as far as that reaches."""

MAX_NODES: Final = 65_534
BROADCAST: Final = NodeId(0xFFFF)
"""The destination that means every station in range (radio) or every node (routing)."""


LIGHT_M_PER_S: Final = 299_792_458
GOLDEN_ANGLE: Final = math.pi * (3 - math.sqrt(5))
"""The angle [rad] between the bearings of successive ids that spreads any number of them evenly over a circle."""
DEFAULT_ORIGIN_DEG: Final = (37.5665, 126.978)
"""Latitude and longitude of the origin of a swarm that nobody has put anywhere: the city hall of Seoul."""
FARTHEST_M: Final = 1e7
"""The greatest coordinate: no swarm is so large, and its square is still exact."""
FASTEST_M_S: Final = 1e4

_new: Final = tuple.__new__  # faster than the constructor, for vectors that are computed all the time


class Enu(NamedTuple):
    """A vector in east, north, up: metres, or metres per second for a velocity."""

    east: float
    """The component to the east."""
    north: float
    """The component to the north."""
    up: float
    """The component upwards."""

    def minus(self, other: "Enu") -> "Enu":
        """The vector from another one to this one."""
        return _new(Enu, (self.east - other.east, self.north - other.north, self.up - other.up))

    def plus(self, other: "Enu", times: float = 1.0) -> "Enu":
        """The sum of this vector and so many times another one."""
        return _new(Enu, (self.east + times * other.east, self.north + times * other.north, self.up + times * other.up))

    def norm(self) -> float:
        """Euclidean length [m or m/s]."""
        return math.hypot(self.east, self.north, self.up)

    def horizontal(self) -> float:
        """Length without the component upwards [m or m/s]."""
        return math.hypot(self.east, self.north)

    def horizontal_to(self, other: "Enu") -> float:
        """The distance from another place without the component upwards [m]."""
        return math.hypot(self.east - other.east, self.north - other.north)

    def is_within(self, most: float) -> bool:
        """True if no component is greater than this, of either sign; false for what is not a number."""
        return abs(self.east) <= most and abs(self.north) <= most and abs(self.up) <= most


STILL: Final = Enu(0.0, 0.0, 0.0)
"""The zero vector: the velocity of what does not move."""


def direction(*, bearing_rad: float, elevation_rad: float) -> Enu:
    """The unit vector of a bearing (from north, clockwise) and an elevation above the horizontal."""
    level = math.cos(elevation_rad)
    return Enu(level * math.sin(bearing_rad), level * math.cos(bearing_rad), math.sin(elevation_rad))


def earliest(*instants_ns: int | None) -> int | None:
    """The first of these instants, leaving out those that are None; None when all are."""
    first_ns = None
    for t_ns in instants_ns:
        if t_ns is not None and (first_ns is None or t_ns < first_ns):
            first_ns = t_ns
    return first_ns


def seconds_to_ns(seconds: float) -> int:
    """Convert seconds, as people write them, to the integer nanoseconds that are used inside."""
    return round(seconds * S)
