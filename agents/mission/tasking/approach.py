"""The approach to a survivor: straight to the estimated place, then to the other probable ones (`look_around.py`), then
on a spiral.

Once a sensor of this UAV has detected a person who seems to own the survivor's phone, the estimated place is that of
the person. The UAV then flies on a circle around it, until the survivor is confirmed.
"""

import math
from collections.abc import Collection
from typing import Final

from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.looked_at import LookedAt
from agents.mission.finding.phone_localization import Estimate, PhoneFilter
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from agents.mission.tasking.look_around import Headway, LookAround
from fanet_mw.trace import Arrived
from fanet_mw.units import GOLDEN_ANGLE, NodeId, S

_GROWTH_M_S: Final = 1.5
"""The speed at which the radius of spiral and circle grows, that of the circle up to `_IN_VIEW_M`."""
_TURN_PER_S: Final = 0.25
"""The greatest angular speed on spiral and circle [rad/s]."""
_SPEED_SHARE: Final = 0.8
"""The share of its greatest speed that a UAV uses on the spiral. The rest is its reserve: a UAV that fell behind the
point that moves along the spiral would cut across it."""
_IN_VIEW_M: Final = 40.0
"""The greatest radius of the circle around a person: from there a camera still sees the person in its middle."""
_FIRST_RADIUS_M: Final = 14.0
"""The radius at which spiral and circle begin."""
_MEASURED_M: Final = 200.0
"""A responder that is this near to the mean of a vague estimate goes round from one probable place to the next, which
tells the powers there as well; it has come to no place yet."""


class Approach:
    """The point to which one UAV flies next when it approaches a survivor, and when it came to each survivor."""

    def __init__(
        self,
        node: NodeId,
        survivors: KnownSurvivors,
        own_motion: OwnMotion,
        neighbors: NeighborMotions,
        outbox: Outbox,
        *,
        arrival_m: float,
        speed_m_s: float,
        looked_at: LookedAt,
    ) -> None:
        self._node = node
        self._survivors, self._own_motion, self._neighbors = survivors, own_motion, neighbors
        self._outbox = outbox
        self._arrival_m = arrival_m
        self._along_m_s = _SPEED_SHARE * speed_m_s
        self._look_around = LookAround(looked_at)
        self._headway = Headway()
        self._others: Collection[int] = ()
        self.arrived_ns: dict[int, int] = {}

    def forget(self, survivor: int) -> None:
        """Begin an approach anew: the place has proved wrong, or was reached in passing or for an earlier task."""
        self.arrived_ns.pop(survivor, None)

    def share(self, others: Collection[int]) -> None:
        """These UAVs respond to the same survivor: each looks at the places nearer to it."""
        self._others = others

    def next_point(self, survivor: int, place: Estimate, now_ns: int, *, responding: bool) -> tuple[float, float]:
        """East and north of the point to fly to: the estimated `place`, another probable one, then a point on spiral or
        circle, which lets the UAV receive phones from many sides. Each UAV starts at an angle of its own; `responding`:
        the survivor is its task.
        """
        arrived_ns = self.arrived_ns.get(survivor)
        if arrived_ns is None:
            away_m = place.distance_m(self._own_motion.position)
            if responding and place.is_vague and away_m < _MEASURED_M:
                phone = self._survivors.by_id[survivor].filter
                return self._place_to_look_at(survivor, phone, now_ns) or (place.east_m, place.north_m)
            there, here = (place.east_m, place.north_m), self._own_motion.position
            held_back = responding and self._headway.is_held_back(there, here, now_ns)
            if away_m > self._arrival_m and not held_back:
                return there
            arrived_ns = self.arrived_ns[survivor] = now_ns  # or it is as near as a building, or the swarm, permits
            if responding and away_m <= self._arrival_m:
                self._outbox.records.append(Arrived(now_ns, self._node, survivor))
        phone = self._survivors.by_id[survivor].filter
        seen = phone.is_seen
        looked_for = None if seen else self._place_to_look_at(survivor, phone, now_ns)
        if looked_for is not None:
            return looked_for
        searched_s = (now_ns - arrived_ns) / S
        radius = _FIRST_RADIUS_M + _GROWTH_M_S * searched_s
        turned = _TURN_PER_S * searched_s if seen else self._turned_rad(radius)
        radius = min(_IN_VIEW_M, radius) if seen else radius
        angle = self._node * GOLDEN_ANGLE + turned
        return place.east_m + radius * math.cos(angle), place.north_m + radius * math.sin(angle)

    def _place_to_look_at(self, survivor: int, phone: PhoneFilter, now_ns: int) -> tuple[float, float] | None:
        """East and north of the next place at which nobody has looked yet; None if there is none."""
        motions = self._neighbors.by_node(now_ns=now_ns)
        others = [motion.position_at(now_ns) for node, motion in motions if node in self._others]
        return self._look_around.next_place(survivor, phone, self._own_motion.position, now_ns, others=others)

    def _turned_rad(self, radius: float) -> float:
        """The spiral's angle at a radius: at `_TURN_PER_S` while the UAV keeps up, farther out as fast as it flies."""
        widest = max(_FIRST_RADIUS_M, self._along_m_s / _TURN_PER_S)
        if radius <= widest:
            return _TURN_PER_S * (radius - _FIRST_RADIUS_M) / _GROWTH_M_S
        turned = _TURN_PER_S * (widest - _FIRST_RADIUS_M) / _GROWTH_M_S
        return turned + self._along_m_s / _GROWTH_M_S * math.log(radius / widest)
