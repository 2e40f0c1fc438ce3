"""The approach to a survivor: straight to the estimate, then about it until a person is seen."""

import math
from typing import Final

from agents.mission.finding.finds import Finds
from agents.mission.finding.phone_filter import Estimate
from agents.mission.navigation.navigation import Navigation
from agents.mission.outbox import Outbox
from fanet_mw.trace import Arrived
from fanet_mw.units import GOLDEN_ANGLE, NodeId, S

_GROWTH_M_S: Final = 1.5
"""The radius of the spiral that is flown around an estimate at which no person is seen grows at this speed."""
_TURN_PER_S: Final = 0.25
"""The greatest rate at which it turns [rad/s]."""
_FLOWN: Final = 0.8
"""The share of its greatest speed at which a UAV flies along the spiral, so that it does not fall behind and cut it."""
_IN_VIEW_M: Final = 40.0
"""From a circle of this radius a camera still shows a person in its middle."""
_RING_M: Final = 14.0


class Approach:
    """The places to which one UAV flies near survivors, and the instants at which it came to each."""

    def __init__(
        self,
        node: NodeId,
        finds: Finds,
        navigation: Navigation,
        outbox: Outbox,
        *,
        arrival_m: float,
        speed_m_s: float,
    ) -> None:
        """`speed_m_s`: the greatest speed of this UAV."""
        self._node = node
        self._finds, self._navigation = finds, navigation
        self._outbox = outbox
        self._arrival_m = arrival_m
        self._along_m_s = _FLOWN * speed_m_s
        self.arrived_ns: dict[int, int] = {}
        """The instant at which this UAV came to each survivor."""

    def forget(self, survivor: int) -> None:
        """Take a survivor as one at which this UAV has not been yet: where it came to was not the place."""
        self.arrived_ns.pop(survivor, None)

    def point(self, survivor: int, place: Estimate, now_ns: int, *, responding: bool) -> tuple[float, float]:
        """East and north of the place to fly to: on a spiral, at an angle of the UAV's own, until a person is in view.

        A circle about a person in view gives received powers from new places, which show whose phone it is.

        `responding`: True if this survivor is the UAV's task, and not only one that it passes.
        """
        arrived_ns = self.arrived_ns.get(survivor)
        if arrived_ns is None:
            if place.distance_m(self._navigation.position) > self._arrival_m:
                return place.east_m, place.north_m
            arrived_ns = self.arrived_ns[survivor] = now_ns
            if responding:
                self._outbox.records.append(Arrived(now_ns, self._node, survivor))
        seen = self._finds.known[survivor].filter.is_seen
        searched_s = (now_ns - arrived_ns) / S
        radius = _RING_M + _GROWTH_M_S * searched_s
        turned = _TURN_PER_S * searched_s if seen else self._turned_rad(radius)
        radius = min(_IN_VIEW_M, radius) if seen else radius
        angle = self._node * GOLDEN_ANGLE + turned
        return place.east_m + radius * math.cos(angle), place.north_m + radius * math.sin(angle)

    def _turned_rad(self, radius: float) -> float:
        """How far the spiral has turned at a radius: at its rate as long as the UAV can keep up, then at its speed."""
        widest = max(_RING_M, self._along_m_s / _TURN_PER_S)
        if radius <= widest:
            return _TURN_PER_S * (radius - _RING_M) / _GROWTH_M_S
        turned = _TURN_PER_S * (widest - _RING_M) / _GROWTH_M_S
        return turned + self._along_m_s / _GROWTH_M_S * math.log(radius / widest)
