"""The closest point of approach against a brute-force look at every instant."""

import math

from hypothesis import given
from hypothesis import strategies as st

from agents.applications.collision_avoidance import closest
from fanet_mw.units import Enu

lengths = st.floats(-500, 500, allow_nan=False)
speeds = st.floats(-30, 30, allow_nan=False)
vectors = st.builds(Enu, lengths, lengths, lengths)
velocities = st.builds(Enu, speeds, speeds, speeds)
STEPS = 2000


def distance_m(position: Enu, velocity: Enu, t_s: float) -> float:
    return math.hypot(*(p + v * t_s for p, v in zip(position, velocity, strict=True)))


@given(vectors, velocities, st.floats(0.1, 60))
def test_no_sampled_instant_is_nearer_and_one_is_as_near(position: Enu, velocity: Enu, within_s: float) -> None:
    found = closest(position, velocity, within_s=within_s)
    sampled = [distance_m(position, velocity, within_s * i / STEPS) for i in range(STEPS + 1)]
    step_m = velocity.norm() * within_s / STEPS
    assert 0 <= found.closest_s <= within_s
    assert found.distance_m <= min(sampled) + 1e-6
    assert found.distance_m >= min(sampled) - step_m - 1e-6
    assert math.isclose(found.distance_m, distance_m(position, velocity, found.closest_s), abs_tol=1e-6)


@given(vectors, velocities, st.floats(0.1, 60))
def test_both_bodies_find_the_same(position: Enu, velocity: Enu, within_s: float) -> None:
    ours = closest(position, velocity, within_s=within_s)
    theirs = closest(Enu(*(-p for p in position)), Enu(*(-v for v in velocity)), within_s=within_s)
    assert ours.closest_s == theirs.closest_s
    assert ours.distance_m == theirs.distance_m


@given(vectors)
def test_bodies_at_rest_to_each_other_are_nearest_now(position: Enu) -> None:
    assert closest(position, Enu(0, 0, 0), within_s=9.0) == (0.0, position)
