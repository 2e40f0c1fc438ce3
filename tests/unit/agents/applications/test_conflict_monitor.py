"""The conflict monitor of one UAV, as timelines: two on one line, 200 m apart, closing at 20 m/s."""

from typing import Any

import pytest

from agents.applications.collision_avoidance import ConflictMonitor
from fanet_mw.application import HOME, Course
from fanet_mw.mavlink import Collision
from fanet_mw.motion import Motion
from fanet_mw.trace import ConflictForeseen, ConflictOver
from fanet_mw.units import MS, STILL, Enu, NodeId, S

EAST, WEST = Enu(10, 0, 0), Enu(-10, 0, 0)
OTHER = NodeId(7)


@pytest.fixture
def monitor(make_scenario):
    def make(node: int = 3, **keys: Any) -> ConflictMonitor:
        wanted = {"nodes.count": 9, "mission.collision_horizon_s": 12, "mission.collision_distance_m": 15}
        exact = {"sensors.gps_vertical": 0.0}  # heights, so that levels are where they are said to be
        return ConflictMonitor(make_scenario(**wanted, **exact | keys), NodeId(node))

    return make


def at(east: float, up: float, velocity: Enu, now_ns: int = 0) -> Motion:
    return Motion(Enu(east, 0, up), velocity, now_ns)


def test_who_foresees_a_conflict_warns_and_the_lower_id_goes_up(monitor) -> None:
    for node, up in ((3, 90.0), (9, 10.0)):
        uav = monitor(node)
        uav.on_hello(OTHER, at(200, 50, WEST), now_ns=0)
        uav.on_fix(at(0, 50, EAST))
        (record,) = uav.records
        assert record == ConflictForeseen(0, node, OTHER, 10_000, 0.0, told=False)
        ((other, approach),) = uav.warnings
        assert (other, approach.closest_s) == (OTHER, 10.0)
        assert uav.course is not None
        assert uav.course.position == Enu(100, 0, up)
        assert uav.course.speed_m_s > 10, "as fast as before, and up or down as well"


def test_a_warning_is_repeated_after_its_interval_and_not_when_the_other_has_just_said_it(monitor) -> None:
    uav = monitor()
    said = []
    for tenth in range(40):
        now_ns = tenth * 100 * MS
        uav.on_hello(OTHER, at(200 - 1.0 * tenth, 50, WEST, now_ns), now_ns=now_ns)
        if tenth == 15:
            uav.on_warning(OTHER, Collision(3, 8.5, 0.0, 0.0), at(15, 50, EAST, now_ns), born_ns=now_ns, now_ns=now_ns)
        uav.on_fix(at(1.0 * tenth, 50, EAST, now_ns))
        said += [tenth] * len(uav.warnings)
        uav.warnings = []
    assert said == [0, 10, 25, 35]


def test_a_uav_that_passes_far_enough_is_no_conflict(monitor) -> None:
    uav = monitor()
    uav.on_hello(OTHER, Motion(Enu(200, 16, 50), WEST, 0), now_ns=0)
    uav.on_fix(at(0, 50, EAST))
    uav.on_hello(OTHER, at(200, 66, WEST), now_ns=0)
    uav.on_fix(at(0, 50, EAST, 1))
    uav.on_hello(OTHER, at(300, 50, WEST), now_ns=0)
    uav.on_fix(at(0, 50, EAST, 2))
    assert uav.records == uav.warnings == []
    assert uav.course is None


def test_a_warning_that_names_us_is_heeded_though_we_hear_nothing_of_its_sender(monitor) -> None:
    uav = monitor()
    uav.on_warning(OTHER, Collision(4, 8.0, 0.0, 3.0), at(0, 50, EAST), born_ns=0, now_ns=S)
    assert uav.course is None, "it was about another"
    uav.on_warning(OTHER, Collision(3, 8.0, 4.0, 3.0), at(0, 50, EAST), born_ns=0, now_ns=S)
    assert uav.records == [ConflictForeseen(S, 3, OTHER, 7000, 5.0, told=True)]
    assert uav.course is not None
    assert uav.warnings == []
    for second in range(2, 13):
        uav.on_fix(at(10 * second, 50, EAST, second * S))
    assert uav.records[-1] == ConflictOver(12 * S, 3, OTHER)
    assert uav.course.speed_m_s == HOME


@pytest.mark.parametrize("closest_s", [13.1, 1e30, 0.0])
def test_a_warning_of_what_is_past_or_beyond_the_horizon_is_ignored(monitor, closest_s) -> None:
    uav = monitor()
    uav.on_warning(OTHER, Collision(3, closest_s, 0.0, 0.0), at(0, 50, EAST), born_ns=0, now_ns=S)
    assert uav.course is None


@pytest.mark.parametrize(
    "goal", [Course(Enu(500, 0, 50), 10.0), Course(Enu(500, 0, 50), 0.0, STILL)], ids=["flies on", "waits in the air"]
)
def test_a_conflict_is_over_when_the_two_have_passed_and_the_mission_goes_on(monitor, goal) -> None:
    uav = monitor()
    uav.on_course(goal)
    assert not uav.avoids
    for second in range(14):
        now_ns = second * S
        uav.on_hello(OTHER, at(200 - 10 * second, 42, WEST, now_ns), now_ns=now_ns)
        uav.on_fix(at(10 * second, 50 + min(15, 4 * second), EAST, now_ns))
    (over,) = [r for r in uav.records if isinstance(r, ConflictOver)]
    assert 11 * S < over.t_ns <= 12 * S
    assert uav.course == goal


def test_the_mission_s_course_waits_until_the_conflict_is_over(monitor) -> None:
    uav = monitor()
    uav.on_hello(OTHER, at(200, 50, WEST), now_ns=0)
    uav.on_fix(at(0, 50, EAST))
    uav.on_course(Course(Enu(0, 90, 50), 10.0))
    assert uav.avoids
    uav.on_fix(at(0, 50, EAST, 1))
    assert uav.course is not None
    assert uav.course.position == Enu(0, 100, 90), "towards the goal, and up"


def test_of_two_others_the_one_above_and_the_one_below_leave_the_middle_level(monitor) -> None:
    uav = monitor(5)
    for node, north in ((3, 0.0), (7, 5.0)):
        uav.on_hello(NodeId(node), Motion(Enu(200, north, 50), WEST, 0), now_ns=0)
    uav.on_fix(at(0, 50, EAST))
    assert uav.course is not None
    assert uav.course.position.up == 50


@pytest.mark.parametrize(("age_s", "is_taken"), [(3.4, True), (3.6, False)])
def test_a_position_that_is_too_old_is_refused(monitor, age_s, is_taken) -> None:
    now_ns = 10 * S
    assert monitor().on_hello(OTHER, at(0, 50, WEST, now_ns - round(age_s * S)), now_ns=now_ns) is is_taken


def test_many_at_once_are_parted_by_two_levels_at_most(monitor) -> None:
    """Node 1 of five that come from different sides: `nodes.altitude_m` has room for two levels of 15 m."""
    uav = monitor(1)
    for other in range(2, 7):
        uav.on_hello(NodeId(other), Motion(Enu(200, 0, 50 + 0.1 * other), WEST, 0), now_ns=0)
    uav.on_fix(at(0, 50, EAST))
    assert len([r for r in uav.records if isinstance(r, ConflictForeseen)]) == 5
    now_ns, up_m = 0, 50.0
    for _ in range(60):  # as it climbs
        now_ns += S // 2
        uav.on_fix(at(0, up_m, EAST, now_ns))
        if uav.course is None or uav.course.speed_m_s == HOME:
            break
        climb_m = uav.course.position.up - up_m
        up_m += climb_m / 20
        assert up_m <= 80.01
    assert uav.course is not None


def test_who_is_near_but_flies_away_is_no_conflict(monitor) -> None:
    uav = monitor()
    uav.on_hello(OTHER, at(12, 50, EAST), now_ns=0)
    uav.on_fix(at(0, 50, WEST))
    assert uav.records == []
    assert uav.warnings == []


def side_by_side(uav: ConflictMonitor, *, seconds: int) -> Enu:
    """The velocity that a UAV has chosen after flying this long beside another one, in the northeast."""
    for second in range(seconds + 1):
        now_ns = second * S
        velocity = EAST if second else Enu(10, -2, 0)
        uav.on_hello(OTHER, Motion(Enu(300, 310, 50), velocity, now_ns), now_ns=now_ns)
        uav.on_fix(Motion(Enu(300, 300, 50), EAST, now_ns))
    assert uav.course is not None
    way = uav.course.position.minus(Enu(300, 300, 50))
    return Enu(way.east / 10, way.north / 10, 0)


@pytest.mark.parametrize(("node", "seconds", "leaves"), [(9, 19, False), (9, 21, True), (3, 60, False)])
def test_of_two_that_fly_side_by_side_for_long_the_one_with_the_higher_id_leaves_for_the_middle(
    monitor, node: int, seconds: int, leaves: bool
) -> None:
    velocity = side_by_side(monitor(node), seconds=seconds)
    assert velocity.norm() == pytest.approx(10)
    assert (velocity.east, velocity.north) == pytest.approx((-7.07, -7.07) if leaves else (10, 0), abs=0.01)


def level_m(uav: ConflictMonitor, up_m: float, others: tuple[int, ...]) -> float:
    """How high a UAV goes, which is near that level, for others that come towards it."""
    for other in others:
        uav.on_hello(NodeId(other), at(200, up_m, WEST), now_ns=0)
    uav.on_fix(at(0, up_m, EAST))
    course = uav.course
    for step in range(1, 400):  # as it flies there
        if course is None:
            break
        up_m += (course.position.up - up_m) / 100
        uav.on_fix(at(0.01 * step, up_m, EAST, step))
        course = uav.course
    return up_m


@pytest.mark.parametrize(("vertical", "higher_m"), [(0.0, 0.0), (2.0, 12.65), (10.0, 30.0)])
def test_levels_are_higher_by_three_times_the_error_of_a_height_and_apart_as_ever(
    monitor, vertical: float, higher_m: float
) -> None:
    """By GPS 2.11 m along a horizontal axis, and `gps_vertical` times as much upwards."""
    for node, level in ((1, 30.0), (3, 0.0), (9, -30.0)):
        others = tuple(other for other in (1, 3, 9) if other != node)
        uav = monitor(node, **{"sensors.gps_vertical": vertical})
        assert level_m(uav, 50.0, others) == pytest.approx(50 + level + higher_m, abs=0.7)


@pytest.mark.parametrize(("node", "stood_s", "goes_back"), [(3, 6, False), (3, 9, True), (9, 9, False), (9, 16, True)])
def test_who_stands_at_the_geofence_while_it_avoids_others_flies_back_and_the_lower_id_first(
    monitor, node: int, stood_s: int, goes_back: bool
) -> None:
    uav, here = monitor(node), Enu(290, 290, 50)
    for second in range(stood_s):
        uav.on_hello(OTHER, Motion(here._replace(east=280), Enu(0.5, 0.5, 0), second * S), now_ns=second * S)
        uav.on_fix(Motion(here, Enu(5, 5, 0) if not second else Enu(0, 0, 0), second * S))
    assert uav.course is not None
    assert (uav.course.position.minus(here).east < 0) == goes_back


def test_who_begins_to_avoid_before_it_is_back_at_its_height_descends_no_farther_than_before(monitor) -> None:
    for up_m in (32.0, 40.0):  # the lower ids are above, so this one goes down
        assert level_m(monitor(9, **{"sensors.gps_vertical": 2.0}), up_m, (7, 8)) == pytest.approx(20 + 12.65, abs=0.7)
