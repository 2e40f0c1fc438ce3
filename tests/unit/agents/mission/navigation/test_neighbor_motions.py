"""How long the motion of a neighbor counts as known after its last hello."""

import pytest

from agents.mission.navigation.neighbor_motions import NeighborMotions
from fanet_mw.motion import Motion
from fanet_mw.units import Enu, S

FLIES = Motion(Enu(0.0, 0.0, 50.0), Enu(1.0, 0.0, 0.0), 0)


@pytest.mark.parametrize(("hello_interval_s", "known_s"), [(0.1, 6.0), (1.0, 6.0), (4.0, 14.0)])
def test_a_motion_is_known_for_six_seconds_or_as_long_as_a_neighbor_lasts(
    hello_interval_s: float, known_s: float
) -> None:
    motions = NeighborMotions(hello_interval_s=hello_interval_s)
    motions.on_hello(2, FLIES)
    last_ns = round(known_s * S)
    assert motions.motion(2, now_ns=last_ns) == FLIES
    assert motions.all(now_ns=last_ns) == [FLIES]
    assert motions.motion(2, now_ns=last_ns + 1) is None
    assert motions.all(now_ns=last_ns + 1) == []
