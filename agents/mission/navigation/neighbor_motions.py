"""The positions and velocities of a UAV's neighbors, from their hellos."""

from collections.abc import Mapping, Sequence
from typing import Final

from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw.bus.messages import Echo
from fanet_mw.motion import Motion
from fanet_mw.node.neighbors import neighbor_lifetime_ns
from fanet_mw.units import Enu, seconds_to_ns

_LEAST_LIFETIME_NS: Final = seconds_to_ns(6.0)
"""How long after a neighbor's last hello its motion counts as known, at least: a UAV that is near and not heard is
still there. Where hellos are rare it is as long as a neighbor lasts (`fanet_mw/node/neighbors.py`)."""
_STOPS_S: Final = 2.0
"""A flight controller without a program flies on for a second and then brakes (`VELOCITY_LASTS_NS`), so it stops where
it would have been so long after its last hello."""
_STOPS_BUT_S: Final = 1.0
"""The hello may have been sent so long before the program stopped."""
_UNTIL_LOST_NS: Final = seconds_to_ns(5.0)
"""A UAV that was last heard longer ago than this when it was lost was out of reach. Its place in the formation then
tells where it may be.
"""
_PLACE_BUT_M: Final = 10.0
"""A lost UAV that was out of reach hovers at most this far from its place in the formation."""
_FALLS_M_S: Final = 6.0
"""In a search nobody sinks this fast on purpose."""


def falls(velocity: Enu) -> bool:
    """True for a UAV that falls from the sky."""
    return velocity.up <= -_FALLS_M_S


class NeighborMotions:
    """The motion of each neighbor by its latest hello."""

    def __init__(self, *, hello_interval_s: float = 1.0) -> None:
        self._lifetime_ns = max(_LEAST_LIFETIME_NS, neighbor_lifetime_ns(hello_interval_s))
        self._motions: dict[int, Motion] = {}
        """The latest motion of each neighbor, by id in order."""

    def on_hello(self, node: int, motion: Motion) -> None:
        is_new = node not in self._motions
        self._motions[node] = motion
        if is_new:
            self._motions = dict(sorted(self._motions.items()))

    def motion(self, node: int, *, now_ns: int) -> Motion | None:
        """The last known motion of a neighbor; None if its last hello is too old."""
        motion = self._motions.get(node)
        return None if motion is None or now_ns - motion.at_ns > self._lifetime_ns else motion

    def hovering(self, lost: Mapping[int, int], places: Mapping[int, Enu]) -> list[tuple[Enu, float]]:
        """The places at which silent UAVs may hover, each with a radius; a UAV that said that it fell has none. `lost`:
        since when each is lost; `places`: in the formation, of UAVs that were out of reach.
        """
        found = []
        for node, lost_ns in lost.items():
            last = self._motions.get(node)
            if last is not None and lost_ns - last.at_ns <= _UNTIL_LOST_NS:
                if not falls(last.velocity):
                    flown = last.velocity._replace(up=0.0)
                    found.append((last.position.plus(flown, _STOPS_S), _STOPS_BUT_S * flown.horizontal()))
            elif node in places:
                found.append((places[node], _PLACE_BUT_M))
        return found

    def all(self, *, now_ns: int) -> list[Motion]:
        """The motions of the neighbors that were received recently, by id."""
        return [motion for _, motion in self.by_node(now_ns=now_ns)]

    def by_node(self, *, now_ns: int) -> list[tuple[int, Motion]]:
        """The neighbors that were received recently, each with its motion, by id."""
        return [item for item in self._motions.items() if now_ns - item[1].at_ns <= self._lifetime_ns]


class RadarWatch:
    """The radar of one UAV, whose echoes of neighbors are known to be theirs."""

    def __init__(self, own_motion: OwnMotion, obstacles: KnownObstacles, neighbors: NeighborMotions) -> None:
        self._own_motion, self._obstacles, self._neighbors = own_motion, obstacles, neighbors

    def scan(self, echoes: Sequence[Echo], *, now_ns: int) -> None:
        own = self._own_motion
        others = [motion.position_at(now_ns) for motion in self._neighbors.all(now_ns=now_ns)]
        self._obstacles.radar(echoes, at=own.position, velocity=own.velocity, neighbors=others, now_ns=now_ns)
