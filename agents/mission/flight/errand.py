"""Where a UAV flies by an order of the post on the ground: over a place, or around it on a spiral.

r = sqrt(p v t / pi), angle = tau r / p    p: distance of two turns [m]; v: speed along the spiral [m/s]
"""

import math
from typing import Final

from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.orders import KnownOrders
from fanet_mw.orders import Order, OrderKind
from fanet_mw.units import Enu, S

_PITCH: Final = 1.6
"""The distance of two turns of the spiral, as a multiple of how far the camera looks to all sides."""
_BLIND_M: Final = 60.0
"""That distance for a UAV without a camera, whose receiver reaches farther."""
_THERE_M: Final = 20.0
"""The spiral begins once the UAV is this near to its middle."""


class Errand:
    """The point to which one UAV flies by the order that it carries out."""

    def __init__(
        self, orders: KnownOrders, own_motion: OwnMotion, *, height_m: float, speed_m_s: float, look_m: float
    ) -> None:
        self._orders, self._own_motion = orders, own_motion
        self._height_m, self._speed_m_s = height_m, speed_m_s
        sees_m = _BLIND_M if math.isinf(look_m) else look_m
        self._pitch_m = _PITCH * sees_m
        self._beyond_m = self._pitch_m - sees_m
        """How far the spiral leads beyond the ordered radius: the turn before its last must see as far as there."""
        self._order: Order | None = None
        self._there_ns: int | None = None

    def goal(self, now_ns: int) -> Enu | None:
        """The place to fly to now, with its height above ground; None without an order."""
        order = self._orders.errand
        if order != self._order:
            self._order, self._there_ns = order, None
        if order is None:
            return None
        middle = Enu(order.east_m, order.north_m, self._height_m)
        here = self._own_motion.position
        if self._there_ns is None and middle.horizontal_to(here) <= _THERE_M:
            self._there_ns = now_ns
        if order.kind is OrderKind.STAY or self._there_ns is None:
            return middle
        whole_s = math.pi * (order.radius_m + self._beyond_m) ** 2 / (self._pitch_m * self._speed_m_s)
        searched_s = ((now_ns - self._there_ns) / S) % whole_s
        radius_m = math.sqrt(self._pitch_m * self._speed_m_s * searched_s / math.pi)
        angle = math.tau * radius_m / self._pitch_m
        return Enu(middle.east + radius_m * math.sin(angle), middle.north + radius_m * math.cos(angle), middle.up)
