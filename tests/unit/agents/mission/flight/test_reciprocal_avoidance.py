"""Half-planes of velocities: what obeys them, and what keeps UAVs clear of others."""

import math

from hypothesis import given
from hypothesis import strategies as st
from kit import examples
from search_board import OPEN, UP_M

from agents.mission.flight.reciprocal_avoidance import ReciprocalAvoidance, avoidance_plane
from agents.mission.navigation.half_planes import HalfPlane, nearest
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw.motion import Motion
from fanet_mw.units import Enu, S

speeds = st.tuples(st.floats(-10, 10), st.floats(-10, 10))
planes = st.lists(
    st.builds(
        lambda angle, least: HalfPlane(math.cos(angle), math.sin(angle), least), st.floats(0, 6.28), st.floats(-9, 0)
    ),
    max_size=6,
)


@given(speeds, planes)
def test_a_velocity_that_obeys_every_constraint_is_found_where_standing_still_obeys_them(
    wanted: tuple[float, float], constraints: list[HalfPlane]
) -> None:
    east, north = nearest(wanted, constraints, limit=10, hard=len(constraints))
    assert math.hypot(east, north) <= 10 + 1e-6
    assert all(east * plane.east + north * plane.north >= plane.least - 1e-6 for plane in constraints)


@examples(10)
@given(st.floats(-30, 30), st.floats(0, 6.28), st.floats(4, 10))
def test_two_that_both_avoid_never_come_nearer_than_the_clearance(aside_m: float, angle: float, speed: float) -> None:
    at = [
        [0.0, 0.0],
        [150 * math.cos(angle) - aside_m * math.sin(angle), 150 * math.sin(angle) + aside_m * math.cos(angle)],
    ]
    wanted = [(speed * math.cos(angle), speed * math.sin(angle)), (-speed * math.cos(angle), -speed * math.sin(angle))]
    flown = list(wanted)
    for _ in range(250):
        fresh = []
        for own, other in ((0, 1), (1, 0)):
            offset = Enu(at[other][0] - at[own][0], at[other][1] - at[own][1], 0)
            plane = avoidance_plane(offset, flown[own], flown[other], clearance_m=10, horizon_s=6, share=0.5)
            fresh.append(nearest(wanted[own], [plane], limit=10, hard=1))
        flown = fresh
        for own in (0, 1):
            at[own][0] += 0.1 * flown[own][0]
            at[own][1] += 0.1 * flown[own][1]
        assert math.dist(*at) >= 9.5


def test_neighbors_are_avoided_while_they_are_heard_at_their_level() -> None:
    own_motion, neighbors = OwnMotion(Enu(0, 0, UP_M), OPEN), NeighborMotions()
    own_motion.fix(Enu(0, 0, UP_M), Enu(5, 0, 0), now_ns=0)
    clear = ReciprocalAvoidance(own_motion, neighbors, OPEN)
    neighbors.on_hello(2, Motion(Enu(60, 0, UP_M), Enu(-5, 0, 0), 0))
    neighbors.on_hello(3, Motion(Enu(60, 0, UP_M + 12), Enu(0, 0, 0), 0))
    assert len(clear.planes(S)) == 1
    assert clear.planes(7 * S) == []
