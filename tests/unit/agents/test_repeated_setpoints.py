"""The setpoints of a UAV's computer: a course in the words of the flight controller, and signs of life."""

from collections.abc import Callable

from agents.uav import Setpoints
from fanet_mw.application import Course
from fanet_mw.bus.messages import SetpointKind
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, S

PLACE = Enu(10.0, 20.0, 30.0)
MakeScenario = Callable[..., Scenario]


def made(make_scenario: MakeScenario, *, return_after_s: float) -> Setpoints:
    return Setpoints(make_scenario(**{"mobility.model": "onboard", "mobility.return_after_s": return_after_s}))


def test_the_last_setpoint_is_repeated_three_times_within_the_time_that_a_computer_may_be_silent(
    make_scenario: MakeScenario,
) -> None:
    setpoints = made(make_scenario, return_after_s=6)
    assert setpoints.repeated(9 * S) is None, "there is nothing to repeat"
    first = setpoints.of(Course(PLACE, 2.0, take_off=True), 10 * S)
    assert first.kind is SetpointKind.TAKEOFF
    said = [again.t_ns // S for t_s in range(11, 18) if (again := setpoints.repeated(t_s * S))]
    assert said == [12, 14, 16]
    assert setpoints.of(Course(PLACE, 2.0), 17 * S)._replace(t_ns=19 * S) == setpoints.repeated(19 * S)


def test_a_velocity_is_not_repeated_and_without_the_key_nothing_is(make_scenario: MakeScenario) -> None:
    setpoints = made(make_scenario, return_after_s=6)
    setpoints.of(Course(PLACE, 2.0, Enu(1.0, 0.0, 0.0)), 0)
    assert setpoints.repeated(60 * S) is None
    silent = made(make_scenario, return_after_s=0)
    silent.of(Course(PLACE, 2.0), 0)
    assert silent.repeated(60 * S) is None


def test_each_course_is_a_setpoint_of_its_kind(make_scenario: MakeScenario) -> None:
    setpoints = made(make_scenario, return_after_s=0)
    courses = {
        SetpointKind.POSITION: Course(PLACE, 2.0),
        SetpointKind.VELOCITY: Course(PLACE, 2.0, Enu(1.0, 0.0, 0.0)),
        SetpointKind.TAKEOFF: Course(PLACE, 2.0, take_off=True),
        SetpointKind.LAND: Course(PLACE, 2.0, land=True),
        SetpointKind.RETURN: Course(PLACE, 2.0, go_home=True),
    }
    assert [setpoints.of(course, 0).kind for course in courses.values()] == [*courses]
