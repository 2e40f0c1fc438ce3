"""Which neighbors are silent although they are in reach: their radios or programs have failed, or they fell."""

from collections.abc import Collection, Mapping
from typing import Final, Protocol

from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw.node.neighbors import Silences
from fanet_mw.units import MS, NodeId

_NEAR: Final = 0.96
"""A neighbor within this share of the radio's reach would be heard."""
_LEAST_NS: Final = 700 * MS
"""The least time without a frame after which a neighbor counts as silent."""
_HIDDEN_NS: Final = 2000 * MS
"""The same where hills or buildings may hide a neighbor for a moment."""


class HeardByRadio(Protocol):
    """What the search asks its node about links, and tells it about them."""

    @property
    def silences(self) -> Silences:
        """How long neighbors have sent nothing."""

    def parted(self, now_ns: int, *, without: Collection[int] = ()) -> Collection[NodeId]:
        """The nodes to which there was a way, and is none any more that avoids those in `without`."""

    def hold(self, nodes: Collection[NodeId]) -> None:
        """From now on the UAV flies so that these neighbors, and no others, stay in reach."""

    def lose_sight(self, ends_ns: Mapping[NodeId, int]) -> None:
        """From now on lines of sight to these neighbors, and to no others, are expected to end at these instants."""


class SilentNeighbors:
    """What one UAV concludes from frames that do not come."""

    def __init__(
        self,
        radio: HeardByRadio,
        neighbors: NeighborMotions,
        own_motion: OwnMotion,
        obstacles: KnownObstacles,
        *,
        reach_m: float,
    ) -> None:
        self._radio, self._neighbors, self._own_motion = radio, neighbors, own_motion
        self._reach_m = reach_m
        self._least_ns = _HIDDEN_NS if obstacles.hides else _LEAST_NS

    def parted(self, lost: Collection[int], *, now_ns: int) -> Collection[NodeId]:
        """The UAVs that are in another part of the swarm, or gone: no way leads to them but over lost ones."""
        return self._radio.parted(now_ns, without=lost)

    def has(self, node: NodeId, *, now_ns: int) -> bool:
        """True if a neighbor that must be in reach, by how it flew, is silent for an unusually long time."""
        if not self._radio.silences.is_unusual(node, least_ns=self._least_ns, now_ns=now_ns):
            return False
        return self._is_within(_NEAR * self._reach_m, node, now_ns)

    def might_be_heard(self, node: NodeId, *, now_ns: int) -> bool:
        """True if a neighbor of whom a motion is known would be in reach now, had it kept its velocity."""
        return self._is_within(self._reach_m, node, now_ns)

    def _is_within(self, metres: float, node: NodeId, now_ns: int) -> bool:
        motion = self._neighbors.motion(node, now_ns=now_ns)
        return motion is not None and motion.offset_from(self._own_motion.position, now_ns).norm() <= metres
