"""The radar of a UAV beside the hellos of its neighbors: an echo where a neighbor says that it is tells nothing new."""

from collections.abc import Sequence

from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.navigation import Navigation
from agents.mission.navigation.neighbor_motions import NeighborMotions
from fanet_mw.bus.messages import Echo


class RadarWatch:
    """What the radar of one UAV shows, and which neighbors the UAV avoids where their hellos say that they are."""

    def __init__(
        self,
        navigation: Navigation,
        obstacles: KnownObstacles,
        neighbors: NeighborMotions,
        avoid_by: Sequence[str],
    ) -> None:
        """`avoid_by` names what the UAV avoids others by: `hellos`, `radar`, or both."""
        self._navigation, self._obstacles = navigation, obstacles
        self._looks = "radar" in avoid_by
        self.avoided = neighbors if "hellos" in avoid_by else NeighborMotions()
        """The neighbors that the UAV avoids by their hellos; none of them if hellos are not used."""

    def scan(self, echoes: Sequence[Echo], *, now_ns: int) -> None:
        """Take in the echoes of a scan."""
        if self._looks:
            own = self._navigation
            others = [motion.position_at(now_ns) for motion in self.avoided.all(now_ns=now_ns)]
            self._obstacles.radar(echoes, at=own.position, velocity=own.velocity, neighbors=others, now_ns=now_ns)
