"""A UAV gets around what its map and its radar show, and keeps clear of it."""

import itertools
import math
import pickle
from collections.abc import Sequence

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from kit import examples

from agents.mission.navigation.half_planes import nearest
from agents.mission.navigation.known_obstacles import OVER_M, KnownObstacles
from agents.mission.navigation.onboard_map import NO_MAP, Building, OnboardMap, cell_of, middle_of
from agents.mission.navigation.shortest_way import is_clear, nearest_free, way_around
from fanet_mw.bus.messages import Echo
from fanet_mw.units import MS, Enu, S

STILL = Enu(0.0, 0.0, 0.0)
FIX_NS = 200 * MS
TOWER = Building(0.0, 0.0, 40.0, 20.0, 90.0, yaw_rad=0.4)


def gap_m(buildings: Sequence[Building], at: Enu) -> float:
    return min((building.outside(at.east, at.north)[0] for building in buildings), default=math.inf)


def flown(
    obstacles: KnownObstacles, start: Enu, goal: Enu, *, seconds: int, seen: Sequence[Building] = ()
) -> list[Enu]:
    """The places of a UAV of 10 m/s and 5 m/s2 that wants to go straight to a goal; its radar shows walls `seen`."""
    at, velocity, places = start, STILL, [start]
    for step in range(5 * seconds):
        now_ns = step * FIX_NS
        if seen and step % 5 == 0:
            obstacles.radar(echoes_of(seen, at, velocity), at=at, velocity=velocity, neighbors=(), now_ns=now_ns)
        aim = obstacles.way_to(at, goal, STILL, now_ns=now_ns) or goal
        off = aim.minus(at)
        speed = min(10.0, 0.4 * math.hypot(off.east, off.north))
        length = max(1e-6, math.hypot(off.east, off.north))
        wanted = off.east / length * speed, off.north / length * speed
        planes = obstacles.planes(at, now_ns)
        east, north = nearest(wanted, planes, limit=10.0, hard=len(planes))
        change_e, change_n = east - velocity.east, north - velocity.north
        share = min(1.0, 1.0 / max(1e-9, math.hypot(change_e, change_n)))  # 5 m/s2 for 0.2 s
        velocity = Enu(velocity.east + share * change_e, velocity.north + share * change_n, 0.0)
        at = Enu(at.east + 0.2 * velocity.east, at.north + 0.2 * velocity.north, at.up)
        places.append(at)
    return places


def echoes_of(walls: Sequence[Building], at: Enu, velocity: Enu) -> list[Echo]:
    """What a radar of 36 level beams would tell of walls, without noise."""
    found = []
    for beam in range(36):
        bearing = math.radians(10 * beam)
        east, north = math.sin(bearing), math.cos(bearing)
        for range_m in range(1, 120, 2):
            if gap_m(walls, Enu(at.east + range_m * east, at.north + range_m * north, at.up)) <= 0:
                found.append(Echo(range_m, bearing, 0.0, velocity.east * east + velocity.north * north, 20.0))
                break
    return found


@pytest.mark.parametrize("east_m", [0, 4, 48, 100])
def test_a_straight_way_is_clear_if_nothing_is_on_any_part_of_it(east_m: float) -> None:
    there = cell_of(east_m, 0.0)
    assert not is_clear((0.0, 0.0), (100.0, 0.0), lambda cell: cell == there)
    assert is_clear((0.0, 12.0), (100.0, 12.0), lambda cell: cell == there)


def test_echoes_that_have_faded_are_forgotten() -> None:
    """After an hour of false echoes all over the area each fix looked at thousands of them."""
    obstacles = KnownObstacles(NO_MAP)

    def grown_by(scans: range) -> int:
        for second in scans:
            at, echo = Enu(12.0 * second, 0.0, 60.0), Echo(30.0, 1.0, 0.0, 0.0, 20.0)
            obstacles.radar([echo], at=at, velocity=STILL, neighbors=(), now_ns=second * S)
        return len(pickle.dumps(obstacles))

    first = grown_by(range(20))
    assert grown_by(range(20, 400)) < 1.5 * first


def test_a_tower_on_the_map_is_flown_around() -> None:
    places = flown(KnownObstacles(OnboardMap((TOWER,))), Enu(-100, 3, 60), Enu(100, -3, 60), seconds=40)
    assert min(gap_m([TOWER], place) for place in places) > 4.0
    assert places[-1].minus(Enu(100, -3, 60)).norm() < 5.0


def test_a_tower_that_is_not_on_the_map_is_seen_by_radar_and_flown_around() -> None:
    places = flown(KnownObstacles(NO_MAP), Enu(-100, 3, 60), Enu(100, -3, 60), seconds=40, seen=[TOWER])
    assert min(gap_m([TOWER], place) for place in places) > 2.5
    assert places[-1].minus(Enu(100, -3, 60)).norm() < 5.0


def test_roofs_well_below_are_flown_over_and_nobody_sinks_onto_them() -> None:
    low = TOWER._replace(roof_m=40.0)
    obstacles = KnownObstacles(OnboardMap((low,)))
    at, velocity = Enu(-15.0, 0.0, 60.0), Enu(8.0, 0.0, 0.0)
    assert obstacles.planes(at, 0) == []
    assert obstacles.way_to(at, Enu(100, 0, 60), STILL, now_ns=0) is None
    assert obstacles.least_up_m(at, velocity) == pytest.approx(47.0)
    assert obstacles.least_up_m(Enu(-100.0, 0.0, 60.0), velocity) == -math.inf


def test_the_least_height_is_that_over_the_roofs_ahead_and_not_behind() -> None:
    """A roof of 20 m, 25 m east: reached within 3 s at 10 m/s, and not by who flies away from it or below it."""
    obstacles = KnownObstacles(OnboardMap((Building(25.0, 0.0, 10.0, 10.0, 20.0),)))
    over_m = obstacles.least_up_m(Enu(0.0, 0.0, 60.0), Enu(10.0, 0.0, 0.0))
    assert over_m == 20.0 + OVER_M
    for up_m, east_m_s in ((60.0, -10.0), (60.0, 0.0), (20.0 + OVER_M - 1, 10.0)):
        assert obstacles.least_up_m(Enu(0.0, 0.0, up_m), Enu(east_m_s, 0.0, 0.0)) == -math.inf


def test_nobody_flies_into_an_area_that_is_forbidden_however_high() -> None:
    area = (0.0, 10.0, 50.0)
    places = flown(KnownObstacles(NO_MAP, [area]), Enu(-150, 0, 500), Enu(150, 0, 500), seconds=45)
    assert min(math.hypot(place.east - area[0], place.north - area[1]) for place in places) > 50.0
    assert places[-1].minus(Enu(150, 0, 500)).norm() < 5.0


def test_an_area_that_is_forbidden_in_flight_is_flown_around_where_there_is_nothing_else() -> None:
    start, goal, obstacles = Enu(-100, 1, 60), Enu(100, 0, 60), KnownObstacles(NO_MAP)
    assert obstacles.way_to(start, goal, STILL, now_ns=0) is None
    obstacles.close(0.0, 0.0, 30.0)
    assert obstacles.way_to(start, goal, STILL, now_ns=0) is not None, "it does not come up to the area first"
    places = flown(obstacles, start, goal, seconds=60)
    assert min(at.horizontal() for at in places) > 30
    assert places[-1].horizontal_to(goal) < 2


def test_a_lost_uav_that_hovers_is_flown_around_at_its_height_only() -> None:
    obstacles, place = KnownObstacles(NO_MAP), Enu(0.0, 0.0, 65.0)
    obstacles.hovering = [(place, 7.5)]
    for up_m, passes in ((65.0, False), (71.0, False), (77.0, True)):
        places = flown(obstacles, Enu(-150, 0, up_m), Enu(150, 0, up_m), seconds=45)
        assert places[-1].minus(Enu(150, 0, up_m)).norm() < 5.0
        nearest_m = min(at.minus(place).horizontal() for at in places)
        assert nearest_m < 2.0 if passes else nearest_m > 7.5 + 6.0
    obstacles.hovering = ()
    assert obstacles.way_to(Enu(-50, 0, 65), Enu(50, 0, 65), STILL, now_ns=60 * S) is None


def test_a_goal_within_a_tower_is_awaited_where_it_comes_out() -> None:
    obstacles = KnownObstacles(OnboardMap((TOWER,)))
    there = obstacles.way_to(Enu(60, 0, 60), Enu(0, 0, 60), Enu(5.0, 0.0, 0.0), now_ns=0)
    assert there is not None
    assert there.east > 20
    assert gap_m([TOWER], there) > 5


boxes = st.builds(
    Building,
    st.floats(-70, 70),
    st.floats(-70, 70),
    st.floats(10, 50),
    st.floats(10, 50),
    st.just(100.0),
    st.floats(0, math.pi),
)


@examples(10)
@given(st.lists(boxes, min_size=1, max_size=5))
def test_whatever_stands_there_nobody_hits_it(buildings: list[Building]) -> None:
    start, goal = Enu(-120, 0, 60), Enu(120, 0, 60)
    assume(min(gap_m(buildings, start), gap_m(buildings, goal)) > 12)
    places = flown(KnownObstacles(OnboardMap(tuple(buildings))), start, goal, seconds=25)
    assert min(gap_m(buildings, place) for place in places) > 2.5


@settings(deadline=None)
@given(st.sets(st.tuples(st.integers(-8, 8), st.integers(-8, 8)), max_size=60))
def test_a_way_leads_over_free_cells_only_from_each_to_one_beside_it(walls: set[tuple[int, int]]) -> None:
    start, goal = middle_of((-12, 0)), (12, 0)
    way = way_around(start, goal, walls.__contains__, most_cells=5000)
    assert way[0] == cell_of(*start)
    assert way[-1] == goal
    assert not walls.intersection(way)
    assert all(max(abs(a[0] - b[0]), abs(a[1] - b[1])) == 1 for a, b in itertools.pairwise(way))


def shortest_m(walls: set[tuple[int, int]], start: tuple[int, int], goal: tuple[int, int]) -> float:
    """The length of the shortest way over free cells, found by looking until nothing changes (Bellman-Ford)."""
    far = {start: 0.0}
    changed = [start]
    while changed:
        here = changed.pop(0)
        for east, north in itertools.product((-1, 0, 1), repeat=2):
            there = here[0] + east, here[1] + north
            if there in walls or max(abs(there[0]), abs(there[1])) > 13:
                continue
            if far[here] + math.hypot(east, north) < far.get(there, math.inf) - 1e-9:
                far[there] = far[here] + math.hypot(east, north)
                changed.append(there)
    return far[goal]


@examples(20)
@given(st.sets(st.tuples(st.integers(-6, 6), st.integers(-6, 6)), max_size=100), st.integers(0, 3))
def test_no_way_over_free_cells_is_shorter(walls: set[tuple[int, int]], quarter: int) -> None:
    """From each of the four sides, so that ways lead in all directions."""
    start, goal = [((-12, 1), (12, 0)), ((1, -12), (0, 12)), ((12, 3), (-12, 0)), ((0, 12), (4, -12))][quarter]
    way = way_around(middle_of(start), goal, walls.__contains__, most_cells=5000)
    length = sum(math.dist(a, b) for a, b in itertools.pairwise(way))
    assert length == pytest.approx(shortest_m(walls, start, goal))


def room(size: int) -> set[tuple[int, int]]:
    """Walls so far from the start on all sides, which stands at (20, -30)."""
    cells = itertools.product(range(-size, size + 1), repeat=2)
    return {(20 + c, r - 30) for c, r in cells if max(abs(c), abs(r)) == size}


def test_walls_around_the_start_are_left_where_that_is_shortest() -> None:
    """Wherever the start is; a cell of a wall costs as much as four free ones."""
    for size in (1, 3, 4):
        for goal in ((32, -30), (8, -30), (20, -18), (20, -42)):
            way = way_around(middle_of((20, -30)), goal, room(size).__contains__, most_cells=5000)
            assert len(room(size).intersection(way)) == 1, (size, goal)
            assert sum(math.dist(a, b) for a, b in itertools.pairwise(way)) == pytest.approx(12)
    with_door = room(3) - {(20, -27)}
    way = way_around(middle_of((20, -30)), (24, -26), with_door.__contains__, most_cells=5000)
    assert not with_door.intersection(way), "through the door, which costs less than the wall"


def test_nobody_flies_through_walls_five_cells_off() -> None:
    for goal in ((32, -30), (8, -30), (20, -18), (20, -42)):
        assert way_around(middle_of((20, -30)), goal, room(5).__contains__, most_cells=5000) == []


def test_of_two_ways_the_shorter_one_is_taken() -> None:
    wall = {(0, row) for row in range(-2, 9)}
    way = way_around(middle_of((-5, 0)), (5, 0), wall.__contains__, most_cells=5000)
    assert min(row for _, row in way) == -3
    assert not is_clear(middle_of((-5, 0)), middle_of((5, 0)), wall.__contains__)
    assert nearest_free(middle_of((0, 0)), wall.__contains__, within=3) in {(-1, 0), (1, 0)}


def test_what_flies_and_says_nothing_is_a_mover_and_what_a_neighbor_explains_is_not() -> None:
    at, velocity = Enu(0, 0, 60), Enu(10.0, 0.0, 0.0)
    oncoming = Echo(60.0, math.pi / 2, 0.0, 18.0, 15.0)  # in the east, closing faster than we fly
    obstacles = KnownObstacles(NO_MAP)
    obstacles.radar([oncoming], at=at, velocity=velocity, neighbors=(), now_ns=S)
    (mover,) = obstacles.movers(S)
    assert mover.position.minus(Enu(60, 0, 60)).norm() < 1e-6
    assert mover.velocity.minus(Enu(-8, 0, 0)).norm() < 1e-6
    assert obstacles.planes(at, S) == [], "it is no wall"
    assert obstacles.movers(3 * S) == [], "and it has flown on by now"
    obstacles = KnownObstacles(NO_MAP)
    obstacles.radar([oncoming], at=at, velocity=velocity, neighbors=[Enu(58, 3, 62)], now_ns=S)
    assert obstacles.movers(S) == []


def test_a_single_echo_is_soon_forgotten_and_a_repeated_one_is_kept() -> None:
    at, echo = Enu(0, 0, 60), Echo(25.0, 0.0, 0.0, 0.0, 15.0)
    obstacles = KnownObstacles(NO_MAP)
    obstacles.radar([echo], at=at, velocity=STILL, neighbors=(), now_ns=0)
    assert len(obstacles.planes(at, 2 * S)) == 1
    assert obstacles.planes(at, 4 * S) == []
    obstacles.radar([echo], at=at, velocity=STILL, neighbors=(), now_ns=5 * S)
    obstacles.radar([echo], at=at, velocity=STILL, neighbors=(), now_ns=6 * S)
    assert len(obstacles.planes(at, 15 * S)) == 1


def test_the_ground_ahead_is_that_of_the_map() -> None:
    rows = tuple(tuple(30.0 if column >= 3 else 0.0 for column in range(5)) for _ in range(5))
    obstacles = KnownObstacles(OnboardMap((), rows, 50.0))
    at = Enu(-25.0, 0.0, 60.0)
    assert obstacles.ground_m(Enu(25.0, 0.0, 0.0)) == pytest.approx(15.0)
    assert obstacles.rises_m(at, Enu(10.0, 0.0, 0.0), (2, 6)) == [0.0, pytest.approx(21.0)]
    assert obstacles.rises_m(at, Enu(-10.0, 0.0, 0.0), (2, 6)) == [0.0, 0.0]
    assert KnownObstacles(NO_MAP).rises_m(at, Enu(10.0, 0.0, 0.0), (2, 6)) == []
