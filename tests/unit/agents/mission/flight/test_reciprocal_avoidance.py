"""Half-planes of velocities: what obeys them, and what keeps UAVs clear of others and in reach."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from agents.mission.flight.reciprocal_avoidance import avoiding, staying_near
from agents.mission.navigation.half_planes import HalfPlane, nearest
from fanet_mw.units import Enu

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


@settings(max_examples=30)
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
            plane = avoiding(offset, flown[own], flown[other], clearance_m=10, horizon_s=6, share=0.5)
            fresh.append(nearest(wanted[own], [plane], limit=10, hard=1))
        flown = fresh
        for own in (0, 1):
            at[own][0] += 0.1 * flown[own][0]
            at[own][1] += 0.1 * flown[own][1]
        assert math.dist(*at) >= 9.5


def test_who_is_tied_does_not_fly_out_of_reach() -> None:
    east, other = 0.0, Enu(-100, 0, 0)
    for _ in range(400):
        plane = staying_near(Enu(other.east - east, 0, 0), (0.0, 0.0), tether_m=237, within_s=4)
        velocity = nearest((9.0, 0.0), [] if plane is None else [plane], limit=10, hard=0)
        east += 0.1 * velocity[0]
    assert 130 < east <= 137.5
