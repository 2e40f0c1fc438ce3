"""The place of one UAV in a formation of clusters, and the velocity at which that place moves
(docs/explanation/formation-flight.md). The leader of the formation need not be that of the network, which assigns the
clusters.
"""

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Final

from agents.mission.formation_flight.route import Route
from agents.mission.navigation.neighbor_motions import NeighborMotions
from fanet_mw.motion import Motion
from fanet_mw.units import GOLDEN_ANGLE, STILL, Enu, NodeId

_WIDEST_RAD: Final = math.radians(74.0)
"""A wider gap counts as this one, so that the few UAVs of a small circle stay together: at 200 m from the middle the
two beside such a gap hear each other at 241 m, and need no head between them. Who is beyond a wider one is not heard,
so that its width is not known."""
_TURN: Final = 0.25
"""The turn, as a share of the difference of the two gaps; with a half the UAV would oscillate."""
_MOST_TURN_RAD: Final = math.radians(12.0)
_NO_BEARING_M: Final = 1.0


def place_on_ring(
    middle: Enu, here: Enu, others: Iterable[Enu], *, radius_m: float, node: int, faces: Iterable[Enu] = ()
) -> Enu:
    """The place to fly to at the height of `here`; `faces`: the middles of the circles to be joined."""
    bearing = _bearing(middle, here)
    if bearing is None:
        bearing = node * GOLDEN_ANGLE
    around = [at for other in others if (at := _bearing(middle, other)) is not None]
    turn = _turn_to_face(bearing, around, [at for face in faces if (at := _bearing(middle, face)) is not None])
    if turn is None:
        gaps = [(at - bearing) % (2 * math.pi) for at in around]
        ahead, behind = min([_WIDEST_RAD, *gaps]), min([_WIDEST_RAD, *(2 * math.pi - gap for gap in gaps)])
        turn = _TURN * (ahead - behind)
    angle = bearing + max(-_MOST_TURN_RAD, min(_MOST_TURN_RAD, turn))
    return Enu(middle.east + radius_m * math.sin(angle), middle.north + radius_m * math.cos(angle), here.up)


def _turn_to_face(bearing: float, others: Iterable[float], faces: Iterable[float]) -> float | None:
    """The turn to the nearest of those bearings to which no other UAV of the circle is as near; or None."""
    turns = [
        _signed(face - bearing)
        for face in faces
        if all(abs(_signed(face - bearing)) < abs(_signed(face - other)) for other in others)
    ]
    return min(turns, key=abs, default=None)


def _signed(angle: float) -> float:
    """The angle between -pi and pi."""
    return math.remainder(angle, 2 * math.pi)


def _bearing(middle: Enu, place: Enu) -> float | None:
    east, north = place.east - middle.east, place.north - middle.north
    return None if math.hypot(east, north) < _NO_BEARING_M else math.atan2(east, north)


APART: Final = 2.2
"""The distance of the other heads from the leader, as a multiple of the radius of the circle around a head. The circles
of the clusters then do not touch, as long as no more than six other heads are spread evenly around the leader."""
Clusters = Mapping[NodeId, tuple[NodeId, ...]]


class FlightPlace:
    """Computes the place of one UAV."""

    def __init__(
        self, node: NodeId, motions: NeighborMotions, route: Route, *, radius_m: float, clusters: Callable[[], Clusters]
    ) -> None:
        self._node = node
        self._motions = motions
        self._route = route
        self._radius_m = radius_m
        self._clusters = clusters

    @property
    def is_head(self) -> bool:
        return self._node in self._clusters()

    def at(self, here: Enu, now_ns: int) -> tuple[Enu, Enu]:
        """The place, and the velocity at which it moves."""
        clusters = self._clusters()
        if not clusters or not self._motions.all(now_ns=now_ns):
            return here, STILL
        leader = min(clusters)
        if leader == self._node:
            self._route.led_at(here)
            return here, self._route.velocity(here)
        lead = self._motions.motion(leader, now_ns=now_ns)
        if lead is not None:
            self._route.led_at(lead.position_at(now_ns))
        is_head = self._node in clusters
        head = leader if is_head else self._head_of(self._node, here, clusters, now_ns)
        followed = None if head is None else self._motions.motion(head, now_ns=now_ns)
        if head is None or followed is None:
            return here, STILL if lead is None else lead.velocity
        if is_head:
            beside = self._places(set(clusters) - {head, self._node}, now_ns)
            return self._around(followed, beside, APART * self._radius_m, here, now_ns)
        beside = self._places(set(self._followers(head, clusters, now_ns)) - {self._node}, now_ns)
        faces = self._places(set(clusters) - {head} if head == leader else {leader}, now_ns)
        return self._around(followed, beside, self._radius_m, here, now_ns, faces=faces)

    def _head_of(self, node: int, place: Enu, clusters: Clusters, now_ns: int) -> int | None:
        """The head of a UAV that is none: that of its cluster, or the nearest known one; None if none is known."""
        own = next((head for head, nodes in clusters.items() if node in nodes), None)
        if own is not None:
            return own
        heard = [
            (motion.offset_from(place, now_ns).norm(), head)
            for head in clusters
            if (motion := self._motions.motion(head, now_ns=now_ns)) is not None
        ]
        return min(heard)[1] if heard else None

    def _followers(self, head: int, clusters: Clusters, now_ns: int) -> Iterator[int]:
        """The UAVs that fly around a head, as far as they are received."""
        for node, motion in self._motions.by_node(now_ns=now_ns):
            if node not in clusters and self._head_of(node, motion.position_at(now_ns), clusters, now_ns) == head:
                yield node

    def _places(self, nodes: Collection[int], now_ns: int) -> list[Enu]:
        return [motion.position_at(now_ns) for node, motion in self._motions.by_node(now_ns=now_ns) if node in nodes]

    def _around(
        self,
        followed: Motion,
        others: Iterable[Enu],
        radius_m: float,
        here: Enu,
        now_ns: int,
        *,
        faces: Iterable[Enu] = (),
    ) -> tuple[Enu, Enu]:
        middle = followed.position_at(now_ns)
        place = place_on_ring(middle, here, others, radius_m=radius_m, node=self._node, faces=faces)
        return place, followed.velocity._replace(up=0.0)
