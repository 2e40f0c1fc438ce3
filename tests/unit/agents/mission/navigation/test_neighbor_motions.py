"""How long the motion of a neighbor counts as known after its last hello, and where it may hover if it is lost."""

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


def test_a_neighbor_that_fell_silent_may_hover_where_its_flight_controller_stops_it() -> None:
    motions, at = NeighborMotions(), Enu(0.0, 40.0, 65.0)
    motions.on_hello(2, Motion(at, Enu(0.0, 5.0, 1.0), S))
    motions.on_hello(3, Motion(at, Enu(0.0, 5.0, -7.0), S))
    motions.on_hello(4, Motion(at, Enu(0.0, 5.0, 0.0), S))
    motions.on_hello(5, Motion(at, Enu(0.0, 5.0, 0.0), S))
    falls, left_this_reach_before, never_heard = 3, 4, 6
    lost = {2: 2 * S, falls: 2 * S, left_this_reach_before: 40 * S, never_heard: 2 * S}
    assert motions.hovering(lost, {}) == [(Enu(0.0, 50.0, 65.0), 5.0)]
    assert motions.hovering({}, {}) == []
    places = {node: Enu(300.0, 10.0 * node, 65.0) for node in (*lost, 9)}
    assert motions.hovering(lost, places)[1:] == [(Enu(300.0, 40.0, 65.0), 10.0), (Enu(300.0, 60.0, 65.0), 10.0)]
