"""A neighbor that is near and sends nothing is missed; one that may be out of reach, or hidden, is not so soon."""

from collections.abc import Collection

import pytest

from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.onboard_map import NO_MAP, OnboardMap
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.navigation.silent_neighbors import SilentNeighbors
from fanet_mw.motion import Motion
from fanet_mw.node.neighbors import Silences
from fanet_mw.units import MS, Enu, NodeId, S

OTHER, LAST_NS = NodeId(2), 30 * S
HILLS = OnboardMap((), heights_m=((0.0, 0.0), (0.0, 50.0)))


class Radio:
    """What the node knows of others."""

    def __init__(self) -> None:
        self.silences = Silences(count=3)

    def parted(self, now_ns: int, *, without: Collection[int] = ()) -> tuple[NodeId, ...]:
        return ()

    def hold(self, nodes: Collection[NodeId]) -> None:
        raise AssertionError("nobody steers here")


@pytest.mark.parametrize(
    ("east_m", "east_m_s", "onboard_map", "after_ms"),
    [
        (169.0, 0.0, NO_MAP, 750),
        (169.0, 0.0, HILLS, 2050),
        (249.0, 0.0, NO_MAP, None),
        (235.0, 9.0, NO_MAP, None),
        (249.0, -20.0, NO_MAP, 750),
    ],
)
def test_who_must_be_in_reach_is_missed(
    east_m: float, east_m_s: float, onboard_map: OnboardMap, after_ms: int | None
) -> None:
    radio, neighbors, obstacles = Radio(), NeighborMotions(), KnownObstacles(onboard_map)
    for past in range(400, -1, -1):
        radio.silences.on_frame(OTHER, LAST_NS - past * 50 * MS)
    neighbors.on_hello(OTHER, Motion(Enu(east_m, 0.0, 65.0), Enu(east_m_s, 0.0, 0.0), LAST_NS))
    watch = SilentNeighbors(radio, neighbors, OwnMotion(Enu(0, 0, 65), obstacles), obstacles, reach_m=250.0)
    missed = [ms for ms in range(0, 3000, 50) if watch.has(OTHER, now_ns=LAST_NS + ms * MS)]
    assert (missed[0] if missed else None) == after_ms
