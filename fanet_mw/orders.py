"""Orders from the ground to searching UAVs: what can be ordered, and what is wrong with an order."""

from enum import IntEnum
from typing import Final, NamedTuple

MOST_M: Final = 1e6
"""The greatest distance of an ordered place from the origin along an axis, and the greatest radius."""


class OrderKind(IntEnum):
    """What UAVs are to do; in lower case the kinds of `[[orders]]` and of `fanet order`."""

    RECALL = 1
    """Fly home and land."""
    END = 2
    """The search is over: all fly home and land."""
    STAY = 3
    """Stay over a place."""
    SEARCH = 4
    """Search around a place, up to a radius."""
    RELEASE = 5
    """Take part in the search again."""
    NO_FLY = 6
    """Keep out of a circle, at any height."""


_FOR_ALL: Final = frozenset({OrderKind.RECALL, OrderKind.END, OrderKind.RELEASE, OrderKind.NO_FLY})
AROUND: Final = frozenset({OrderKind.SEARCH, OrderKind.NO_FLY})


class Order(NamedTuple):
    """What is ordered, and of whom."""

    kind: OrderKind
    node: int = 0
    """The UAV; 0: all of them, or with a place the one that the post chooses."""
    east_m: float = 0.0
    north_m: float = 0.0
    radius_m: float = 0.0


def wrong(order: Order, *, uavs: int) -> str | None:
    """What is wrong with an order to a swarm with this number of UAVs, as the end of a sentence; None if nothing is."""
    if not 0 <= order.node <= uavs:
        return f"node = {order.node} must be in [1, {uavs}]"
    if order.node and order.kind in (OrderKind.END, OrderKind.NO_FLY):
        return f"{order.kind.name.lower()} is for all UAVs, not for node {order.node}"
    if not all(abs(value) <= MOST_M for value in (order.east_m, order.north_m, order.radius_m)):  # also false for NaN
        return f"[{order.east_m:g}, {order.north_m:g}] and radius {order.radius_m:g} m must be within {MOST_M:g}"
    if order.kind in AROUND and not order.radius_m > 0:
        return f"radius_m = {order.radius_m:g} must be > 0"
    return None


def is_told(order: Order) -> bool:
    """True for an order as it goes on the air: for one UAV, or for all of them, where that makes sense."""
    return bool(order.node) or order.kind in _FOR_ALL
