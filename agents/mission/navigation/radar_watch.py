"""Combines a UAV's radar with the hellos of its neighbors: echoes near neighbors' stated positions are ignored."""

from collections.abc import Sequence

from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw.bus.messages import Echo


class RadarWatch:
    """The radar of one UAV, and the neighbors that the UAV avoids by their hellos."""

    def __init__(
        self,
        own_motion: OwnMotion,
        obstacles: KnownObstacles,
        neighbors: NeighborMotions,
        avoid_by: Sequence[str],
    ) -> None:
        """`avoid_by`: by what the UAV detects the UAVs to avoid: `hellos`, `radar`, or both."""
        self._own_motion, self._obstacles = own_motion, obstacles
        self._looks = "radar" in avoid_by
        self.avoided = neighbors if "hellos" in avoid_by else NeighborMotions()
        """The neighbors that the UAV avoids by their hellos; none if hellos are not used for that."""

    def scan(self, echoes: Sequence[Echo], *, now_ns: int) -> None:
        """A scan of the radar."""
        if self._looks:
            own = self._own_motion
            others = [motion.position_at(now_ns) for motion in self.avoided.all(now_ns=now_ns)]
            self._obstacles.radar(echoes, at=own.position, velocity=own.velocity, neighbors=others, now_ns=now_ns)
