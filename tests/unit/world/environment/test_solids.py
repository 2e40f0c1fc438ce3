"""Buildings as solids, each against its definition: points in rotated boxes, and rays and paths sampled finely."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from sim.world.environment.obstacles import Box, Obstacles
from sim.world.environment.solids import Solids

boxes = st.builds(
    Box, st.floats(-60, 60), st.floats(-60, 60), st.floats(5, 50), st.floats(5, 50), st.floats(5, 40), st.floats(-3, 3)
)
cities = st.lists(boxes, min_size=1, max_size=3)
points = st.tuples(st.floats(-90, 90), st.floats(-90, 90), st.floats(0, 60))
TILTED = Box(10.0, 20.0, 40.0, 10.0, 15.0, math.pi / 6)


def solids_of(*city: Box) -> Solids:
    return Solids(Obstacles(None, city))


def local(box: Box, point: tuple[float, float, float]) -> tuple[float, float, float]:
    """A point in the axes of a box, from its middle."""
    turned = complex(point[0] - box.east, point[1] - box.north) * complex(math.cos(box.yaw), -math.sin(box.yaw))
    return turned.real, turned.imag, point[2] - box.roof / 2


def distance_m(box: Box, point: tuple[float, float, float]) -> float:
    sides = (box.width, box.depth, box.roof)
    return math.hypot(*(max(0.0, abs(at) - side / 2) for at, side in zip(local(box, point), sides, strict=True)))


def near_edge(city: list[Box], point: tuple[float, float, float]) -> bool:
    """True for points at which rounding decides whether they are above a roof."""
    return any(
        min(abs(abs(x) - box.width / 2), abs(abs(y) - box.depth / 2)) < 1e-6
        for box in city
        for x, y, _ in [local(box, point)]
    )


@given(cities, st.lists(points, min_size=1, max_size=5))
@examples(60)
def test_gaps_and_roofs_are_those_of_the_boxes(city: list[Box], places: list[tuple[float, float, float]]) -> None:
    solids, at = solids_of(*city), np.array(places)
    nearest = [min(point[2], *(distance_m(box, point) for box in city)) for point in places]
    assert solids.gap_m(at).tolist() == pytest.approx(nearest, abs=1e-9)
    for point, surface_m in zip(places, solids.surface_m(at).tolist(), strict=True):
        below = [box.roof for box in city if distance_m(box._replace(roof=1e9), point) == 0.0]
        assert near_edge(city, point) or surface_m == pytest.approx(max(below, default=0.0))
    assert solids.ground_m(at).tolist() == [0.0] * len(places)
    assert solids.top_m == max(box.roof for box in city)


@given(cities, points)
@examples(60)
def test_the_nearest_place_on_each_building_is_on_it_and_as_near_as_it_is(
    city: list[Box], point: tuple[float, float, float]
) -> None:
    for box, wall in zip(city, solids_of(*city).nearest_walls(np.array(point)).tolist(), strict=True):
        assert math.dist(wall, point) == pytest.approx(distance_m(box, point), abs=1e-9)
        assert distance_m(box, (wall[0], wall[1], wall[2])) == pytest.approx(0.0, abs=1e-9)


@given(cities, points, points)
@examples(80)
def test_a_ray_hits_where_a_fine_scan_of_it_first_is_inside(
    city: list[Box], first: tuple[float, float, float], second: tuple[float, float, float]
) -> None:
    length_m = math.dist(first, second)
    if length_m < 1.0:
        return
    solids, start, end = solids_of(*city), np.array([first]), np.array([second])
    direction = (end - start) / length_m
    (hit_m,) = solids.first_hit_m(start, direction, length_m).tolist()
    along = np.linspace(0.0, length_m, 800)
    scanned = [tuple((start[0] + direction[0] * at).tolist()) for at in along]
    depths = [min(distance_m(box, at) for box in city) for at in scanned]
    inside = [at for at, depth in zip(along.tolist(), depths, strict=True) if depth == 0.0]
    step_m = length_m / 799
    if inside:
        assert inside[0] - step_m - 1e-9 <= hit_m <= inside[0] + 1e-9
        assert bool(solids.blocked(start, end)[0]) is (hit_m < length_m)
    elif math.isfinite(hit_m):
        assert min(depths) < step_m, "it grazes a corner between two samples"
    (least_m,) = solids.least_gap_m(start, end, within_m=1e3).tolist()
    scanned_m = min(min(depth, at[2]) for depth, at in zip(depths, scanned, strict=True))
    assert scanned_m - step_m - 1e-6 <= least_m <= scanned_m + 1e-6


def test_what_is_beyond_the_range_is_not_hit_and_what_is_at_its_end_is() -> None:
    solids = solids_of(Box(50.0, 0.0, 20.0, 20.0, 30.0))
    start, east = np.array([[0.0, 0.0, 10.0]]), np.array([[1.0, 0.0, 0.0]])
    assert solids.first_hit_m(start, east, 39.9).tolist() == [math.inf]
    assert solids.first_hit_m(start, east, 40.0).tolist() == [40.0]
    assert solids.first_hit_m(start, -east, 500.0).tolist() == [math.inf], "behind it"
    assert solids.first_hit_m(np.empty((0, 3)), np.empty((0, 3)), 5.0).tolist() == []
    assert solids.first_hit_m(np.array([[50.0, 0.0, 5.0]]), east, 5.0).tolist() == [0.0], "from inside"
    assert solids.blocked(start, np.array([[100.0, 0.0, 10.0]])).tolist() == [True]
    assert solids.blocked(start, np.array([[100.0, 0.0, 70.1]])).tolist() == [False], "over the roof"


def test_a_body_stops_short_of_a_wall_loses_its_speed_and_may_still_rise_beside_it() -> None:
    solids = solids_of(Box(50.0, 0.0, 20.0, 20.0, 30.0))
    before = np.array([[30.0, 0.0, 10.0], [30.0, 40.0, 10.0], [50.0, 0.0, 35.0], [39.0, 0.0, 10.0]])
    after = np.array([[45.0, 0.0, 13.0], [45.0, 40.0, 13.0], [50.0, 0.0, 25.0], [41.0, 0.0, 9.0]])
    velocity = np.array([[9.0, 1.0, 2.0], [9.0, 1.0, 2.0], [0.5, 0.5, -9.0], [2.0, 0.0, -1.0]])
    assert solids.stop(before, after, velocity).tolist() == [True, False, True, True]
    assert after[0].tolist() == pytest.approx([40.0, 0.0, 13.0], abs=0.1)
    assert after[0, 0] < 40.0
    assert velocity[0].tolist() == [0.0, 0.0, 2.0]
    assert (after[1].tolist(), velocity[1].tolist()) == ([45.0, 40.0, 13.0], [9.0, 1.0, 2.0])
    assert after[2].tolist() == pytest.approx([50.0, 0.0, 30.0], abs=0.1)
    assert velocity[2].tolist() == [0.0, 0.0, 0.0], "on the roof it falls no further"
    assert after[3].tolist() == pytest.approx([40.0, 0.0, 9.0], abs=0.1)


def test_corners_near_a_path_are_those_of_the_buildings_beside_it() -> None:
    far = Box(0.0, 300.0, 10.0, 10.0, 12.0)
    solids = solids_of(far, TILTED)
    start, way = np.array([[0.0, 400.0, 10.0], [-60.0, 20.0, 10.0]]), np.array([[9.0, 0.0, 0.0], [140.0, 0.0, 0.0]])
    rays, corners, roofs = solids.corners_near(start, way, margin_m=3.0)
    assert (rays.tolist(), roofs.tolist()) == ([1], [15.0])
    cos, sin = math.cos(TILTED.yaw), math.sin(TILTED.yaw)
    wanted = [(10 + cos * x - sin * y, 20 + sin * x + cos * y) for x, y in ((20, 5), (20, -5), (-20, -5), (-20, 5))]
    assert [tuple(corner) for corner in corners[0].tolist()] == [pytest.approx(corner) for corner in wanted]
    radius_m = math.hypot(20, 5)
    for off_m, found in ((radius_m + 2.9, 1), (radius_m + 3.1, 0)):
        for side in (-1, 1):
            beside = np.array([[-60.0, 20.0 + side * off_m, 10.0]])
            assert len(solids.corners_near(beside, way[1:], margin_m=3.0)[0]) == found
    for short_m, found in ((60.0 + 10.0 - radius_m - 2.9, 1), (60.0 + 10.0 - radius_m - 3.1, 0)):
        rays, _, _ = solids.corners_near(start[1:], np.array([[short_m, 0.0, 0.0]]), margin_m=3.0)
        assert len(rays) == found, "the path ends before it"


def test_a_plain_has_no_solids() -> None:
    for plain in (Solids(None), solids_of()):
        assert (plain.any, plain.hilly, plain.top_m) == (False, False, 0.0)
        assert plain.gap_m(np.array([[3.0, 4.0, 5.0]])).tolist() == [5.0]
        assert plain.surface_m(np.array([[3.0, 4.0, 5.0]])).tolist() == [0.0]
    assert solids_of(TILTED).any
