"""What a UAV answers to the commands of a ground station, and what it then flies."""

import math
from itertools import pairwise

import pytest
from operator_bench import GCS, LAT, LON, Bench, degrees, scenario

from agents.ground_control.application import OVER_AIR, GroundControl
from agents.ground_control.plan_transfer import PlanTransfer
from agents.ground_control.settings import settings_of
from fanet_mw import mavlink
from fanet_mw.application import Course, Fate, Received, Status
from fanet_mw.bus.messages import Gps
from fanet_mw.flavors import Mode, number_of
from fanet_mw.mavlink import Geodetic, common
from fanet_mw.units import STILL, Enu, NodeId, S

ACCEPTED, LATER, DENIED, UNSUPPORTED = 0, 1, 2, 3
ARM, TAKEOFF, LAND, HOME = 400, 22, 21, 20
REPOSITION, SPEED, MODE, START, PAUSE, YAW = 192, 178, 176, 300, 193, 115


def test_every_command_is_acknowledged_and_an_unknown_one_is_unsupported() -> None:
    bench = Bench()
    for number in (*range(1, 600), 31000, 65535):
        assert bench.command(number) in range(7)
        bench.now_ns += 10_000_000  # as many as a UAV looks at in a second
    assert bench.command(31000) == UNSUPPORTED
    assert bench.command(common.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == UNSUPPORTED


def test_who_is_not_armed_does_not_take_off_and_who_flies_is_not_disarmed() -> None:
    bench = Bench()
    assert bench.command(TAKEOFF, 0, 0, 0, math.nan, math.nan, math.nan, 20) == LATER
    bench.airborne()
    assert bench.command(ARM, 0) == LATER
    assert bench.flown.armed


def test_take_off_climbs_straight_up_to_its_height_and_holds() -> None:
    bench = Bench(at=Enu(100.0, 50.0, 0.0))
    bench.airborne(15.0)
    assert bench.position == pytest.approx((100.0, 50.0, 15.0), abs=0.1)
    assert bench.flown.mode is Mode.HOLD


def test_a_take_off_without_a_height_climbs_to_the_parameters() -> None:
    bench = Bench()
    bench.say(common.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 12.5, 9))
    bench.command(ARM, 1)
    assert bench.command(TAKEOFF, 0, 0, 0, math.nan, math.nan, math.nan, math.nan) == ACCEPTED
    assert bench.courses[-1].position.up == 12.5


@pytest.mark.parametrize("place", [(999.0, 0, 20), (0, -181.0, 20), (math.inf, 0, 20), (0, 0, math.inf)])
@pytest.mark.parametrize("number", [TAKEOFF, REPOSITION])
def test_a_command_to_no_place_on_earth_is_denied_not_carried_out_elsewhere(
    number: int, place: tuple[float, float, float]
) -> None:
    bench = Bench()
    bench.command(ARM, 1)
    assert bench.command(number, -1, 1, 0, math.nan, *place) == DENIED
    assert not bench.courses


def test_a_take_off_to_a_height_in_an_unknown_frame_is_denied() -> None:
    bench = Bench()
    bench.command(ARM, 1)
    message = common.MAVLink_command_int_message(1, 1, 99, TAKEOFF, 0, 0, 0, 0, 0, math.nan, 0, 0, 100)
    (ack,) = bench.say(message)
    assert ack.result == DENIED
    assert not bench.courses


def test_a_landing_ends_on_the_ground_disarmed() -> None:
    bench = Bench().airborne()
    assert bench.command(LAND) == ACCEPTED
    assert bench.flown.mode is Mode.LAND
    bench.run(20 / 1.5 + 4)
    assert bench.position.up == 0.0
    assert bench.flown.on_ground
    assert not bench.flown.armed
    assert "Landed and disarmed" in [text.text for text in bench.told("STATUSTEXT")]


def test_who_is_told_to_land_and_does_not_sink_yet_has_not_landed() -> None:
    """A flight controller that was asked for a speed first took 3 s, and was said to have landed 25 m up."""
    bench = Bench().airborne()
    assert bench.command(LAND) == ACCEPTED
    landing = bench.courses.pop()
    bench.courses.append(Course(bench.position, 1.0))
    bench.run(12)
    assert bench.flown.armed
    assert not bench.flown.on_ground
    bench.courses.append(landing)
    bench.run(20 / 1.5 + 4)
    assert bench.flown.on_ground


def test_who_sank_in_a_landing_that_was_broken_off_has_not_landed_before_it_sinks_again() -> None:
    bench = Bench().airborne()
    assert bench.command(LAND) == ACCEPTED
    bench.run(4)
    assert bench.command(PAUSE, 0) == ACCEPTED
    bench.run(3)
    assert bench.command(LAND) == ACCEPTED
    bench.courses.append(Course(bench.position, 1.0))
    bench.run(12)
    assert bench.flown.armed
    assert not bench.flown.on_ground


def test_who_is_told_to_land_where_it_stands_has_landed_after_a_while() -> None:
    """A barometer that drifts says of one that stands that it has taken off."""
    bench = Bench().airborne()
    assert bench.command(LAND) == ACCEPTED
    bench.courses[-1] = Course(bench.position, 1.0)
    bench.run(18)
    assert bench.flown.on_ground


def test_a_return_climbs_first_then_crosses_then_lands_at_home() -> None:
    bench = Bench()
    bench.say(common.MAVLink_param_set_message(1, 1, b"RTL_RETURN_ALT", 40.0, 9))
    bench.airborne()
    go_to(bench, 200, 0, 20)
    bench.run(25)
    assert bench.command(HOME) == ACCEPTED
    ways = len(bench.courses)
    bench.run(90)
    up, over, down = bench.courses[ways - 1 :]
    assert up.position == pytest.approx((200, 0, 40), abs=3)
    assert over.position == pytest.approx((0, 0, 40), abs=3)
    assert down.land
    assert bench.position == pytest.approx((0, 0, 0), abs=3)
    assert bench.flown.on_ground


def test_with_rally_points_a_return_ends_at_the_nearest() -> None:
    bench = Bench()
    x, y = degrees(150, 0)
    upload(bench, [(3, common.MAV_CMD_NAV_RALLY_POINT, x, y, 20.0, (0, 0, 0, 0))], kind=2)
    bench.airborne()
    go_to(bench, 200, 0, 20)
    bench.run(25)
    bench.command(HOME)
    bench.run(120)
    assert bench.position == pytest.approx((150, 0, 0), abs=3.5)
    assert bench.flown.on_ground


def go_to(bench: Bench, east: float, north: float, up: float, *, flags: float = 1) -> int:
    place = mavlink.to_geodetic(Enu(east, north, 0.0), Geodetic(LAT, LON, 0.0))
    x, y = round(place.lat_deg * 1e7), round(place.lon_deg * 1e7)
    message = common.MAVLink_command_int_message(1, 1, 6, REPOSITION, 0, 0, -1, flags, 0, math.nan, x, y, up)
    (ack,) = [answer for answer in bench.say(message) if answer.get_type() == "COMMAND_ACK"]
    return int(ack.result)


def test_a_reposition_flies_there_at_the_parameters_speed() -> None:
    bench = Bench().airborne()
    bench.say(common.MAVLink_param_set_message(1, 1, b"MPC_XY_CRUISE", 8.0, 9))
    assert go_to(bench, 120, -40, 30) == ACCEPTED
    course = bench.courses[-1]
    assert course.position == pytest.approx((120, -40, 30), abs=0.05)
    assert course.speed_m_s == 8.0
    bench.run(20)
    assert bench.position == pytest.approx((120, -40, 30), abs=0.1)


@pytest.mark.parametrize("place", [(501, 0, 20), (0, -700, 20), (0, 0, 1001), (0, 0, 2)])
def test_nobody_is_sent_out_of_the_area(place: tuple[float, float, float]) -> None:
    bench = Bench().airborne()
    flown = len(bench.courses)
    assert go_to(bench, *place) == DENIED
    assert len(bench.courses) == flown


def test_who_stands_on_the_ground_is_not_sent_anywhere() -> None:
    bench = Bench()
    bench.command(ARM, 1)
    assert go_to(bench, 10, 10, 20) == LATER


def test_a_message_is_sent_as_often_as_it_is_requested() -> None:
    """A ground station asks again, in the same words, when the message was lost although the answer was not."""
    bench = Bench()
    for _ in range(3):
        bench.now_ns += S
        answers = bench.say(
            common.MAVLink_command_long_message(1, 1, 512, 0, common.MAVLINK_MSG_ID_HOME_POSITION, *[0] * 6)
        )
        assert [answer.get_type() for answer in answers] == ["HOME_POSITION", "COMMAND_ACK"]


def test_what_was_refused_is_judged_anew_when_it_comes_again() -> None:
    bench = Bench()
    bench.command(ARM, 1)
    assert bench.command(START) == LATER
    upload(bench, square())
    assert bench.command(START) == ACCEPTED


def test_a_question_takes_no_uav_from_those_who_fly_it() -> None:
    bench = Bench(scenario(mobility={"model": "static", "speed_m_s": 10}))
    course = Course(Enu(10.0, 0.0, 20.0), 5.0)
    bench.command(512, common.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    bench.command(511, common.MAVLINK_MSG_ID_ATTITUDE, 100_000)
    assert bench.control.permits(course, bench.now_ns)
    bench.command(ARM, 1)
    assert not bench.control.permits(course, bench.now_ns)


def test_a_speed_of_minus_one_changes_nothing_and_minus_two_takes_it_back() -> None:
    bench = Bench().airborne()
    assert bench.command(SPEED, 1, 4.0) == ACCEPTED
    assert bench.command(SPEED, 1, -1.0) == ACCEPTED
    assert go_to(bench, 40, 0, 20) == ACCEPTED
    assert bench.courses[-1].speed_m_s == 4.0
    assert bench.command(SPEED, 1, -2.0) == ACCEPTED
    assert bench.courses[-1].speed_m_s == 10.0


def test_another_speed_counts_on_the_way_and_later_until_it_is_taken_back() -> None:
    bench = Bench().airborne()
    go_to(bench, 300, 0, 20)
    assert bench.command(SPEED, 1, 4.0) == ACCEPTED
    assert bench.courses[-1] == Course(bench.courses[-2].position, 4.0)
    assert bench.command(SPEED, 1, 90.0) == DENIED
    assert bench.command(SPEED, 1, -2) == ACCEPTED
    assert bench.courses[-1].speed_m_s == 10.0


@pytest.mark.parametrize(("kind", "speed_m_s"), [(1, -50.0), (1, -1.5), (2, 3.0), (3, 3.0), (math.nan, 3.0)])
def test_a_negative_speed_and_one_of_climbing_or_sinking_are_denied_and_change_nothing(
    kind: float, speed_m_s: float
) -> None:
    bench = Bench().airborne()
    bench.command(SPEED, 1, 4.0)
    assert bench.command(SPEED, kind, speed_m_s) == DENIED
    go_to(bench, 40, 0, 20)
    assert bench.courses[-1].speed_m_s == 4.0


def test_a_reposition_that_is_not_flown_leaves_speed_and_heading_as_they_were() -> None:
    bench = Bench()
    bench.command(ARM, 1)
    message = common.MAVLink_command_int_message(1, 1, 6, REPOSITION, 0, 0, 3.0, 0, 0, 1.0, *degrees(10, 10), 20)
    (ack,) = [answer for answer in bench.say(message) if answer.get_type() == "COMMAND_ACK"]
    assert ack.result == LATER
    assert bench.streams.yaw is None
    go_to(bench.airborne(), 40, 0, 20)
    assert bench.courses[-1].speed_m_s == 10.0


def test_who_stands_on_the_ground_does_not_turn() -> None:
    bench = Bench()
    assert bench.command(YAW, 90) == LATER
    assert bench.airborne().command(YAW, 90) == ACCEPTED


@pytest.mark.parametrize("number", [511, 510, 512])
def test_there_is_no_message_between_two_numbers(number: int) -> None:
    assert Bench().command(number, common.MAVLINK_MSG_ID_ATTITUDE + 0.5, 100_000) == DENIED


def test_modes_are_set_by_both_messages() -> None:
    bench = Bench().airborne()
    number = number_of(Mode.GUIDED)
    assert bench.command(MODE, 1, number >> 16 & 0xFF, number >> 24) == ACCEPTED
    assert bench.flown.mode is Mode.GUIDED
    (ack,) = bench.say(common.MAVLink_set_mode_message(1, 1, number_of(Mode.LAND)))
    assert (ack.command, ack.result) == (11, ACCEPTED)
    assert bench.flown.mode is Mode.LAND
    assert bench.command(MODE, 1, 7, 0) == UNSUPPORTED  # stabilized: nobody holds a stick
    assert bench.flown.mode is Mode.LAND


def velocity(bench: Bench, north: float, east: float) -> None:
    bench.say(
        common.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, common.MAV_FRAME_LOCAL_NED, 0b110111000111, 0, 0, 0, north, east, 0, 0, 0, 0, 0, 0
        )
    )


def test_setpoints_fly_in_the_guided_mode_alone() -> None:
    bench = Bench().airborne()
    velocity(bench, 3, 4)
    assert bench.courses[-1].velocity is None
    bench.say(common.MAVLink_set_mode_message(1, 1, number_of(Mode.GUIDED)))
    velocity(bench, 3, 4)
    assert bench.courses[-1].velocity == Enu(4.0, 3.0, 0.0)
    assert bench.courses[-1].speed_m_s == 5.0
    assert bench.control.report()["operator_refused_setpoints"] == 1


def test_who_gets_no_more_setpoints_holds() -> None:
    bench = Bench().airborne()
    bench.say(common.MAVLink_set_mode_message(1, 1, number_of(Mode.GUIDED)))
    for _ in range(5):
        velocity(bench, 5, 0)
        bench.run(0.4)
    assert bench.position.north == pytest.approx(10, abs=0.1)
    bench.run(3)
    assert bench.flown.mode is Mode.HOLD
    assert bench.position.north == pytest.approx(15, abs=2.5)


def test_setpoints_that_make_no_sense_are_counted() -> None:
    bench = Bench().airborne()
    bench.say(common.MAVLink_set_mode_message(1, 1, number_of(Mode.GUIDED)))
    flown = len(bench.courses)
    velocity(bench, math.nan, 0)
    velocity(bench, math.inf, 0)
    assert len(bench.courses) == flown
    assert bench.control.report()["operator_senseless_setpoints"] == 2


@pytest.mark.parametrize(("action", "mode"), [(0, Mode.HOLD), (1, Mode.HOLD), (2, Mode.RETURN), (3, Mode.LAND)])
def test_what_happens_when_the_operator_falls_silent(action: int, mode: Mode) -> None:
    bench = Bench().airborne()
    bench.say(common.MAVLink_param_set_message(1, 1, b"NAV_DLL_ACT", action, 9))
    bench.say(common.MAVLink_param_set_message(1, 1, b"COM_DL_LOSS_T", 5.0, 9))
    go_to(bench, 400, 0, 20)
    bench.run(4.4, heartbeats=False)
    before = len(bench.courses)
    assert bench.control.report().get("operator_silences") is None
    bench.run(2, heartbeats=False)
    assert bench.control.report()["operator_silences"] == 1
    assert bench.flown.mode is mode
    assert (len(bench.courses) == before) == (action == 0)


def test_beyond_an_uploaded_fence_the_uav_holds_and_says_so() -> None:
    bench = Bench().airborne()
    go_to(bench, 300, 0, 20)
    corners = [degrees(east, north) for east, north in ((-50, -50), (50, -50), (50, 50), (-50, 50))]
    upload(bench, [(0, 5001, x, y, 0.0, (4, 0, 0, 0)) for x, y in corners], kind=1)
    bench.run(20)
    assert bench.flown.mode is Mode.HOLD
    assert bench.position.east == pytest.approx(50, abs=5)
    assert "Beyond the geofence: holding" in [text.text for text in bench.told("STATUSTEXT")]
    assert go_to(bench, 60, 0, 20) == DENIED
    assert go_to(bench, 40, 0, 20) == ACCEPTED


def upload(
    bench: Bench, items: list[tuple[int, int, int, int, float, tuple[float, ...]]], *, kind: int = 0, lose: int = -1
) -> int:
    """Upload as a ground station does; `lose`: the first transmission of that item is lost."""
    answers = bench.say(common.MAVLink_mission_count_message(1, 1, len(items), kind))
    for _ in range(4 * len(items) + 4):
        wanted = [answer for answer in answers if answer.get_type() == "MISSION_REQUEST_INT"]
        acks = [answer for answer in answers if answer.get_type() == "MISSION_ACK"]
        if acks:
            return int(acks[-1].type)
        if not wanted:
            before = len(bench.heard)
            bench.run(2)
            answers = bench.heard[before:]
            continue
        seq = wanted[-1].seq
        if seq == lose:
            lose, answers = -1, []
            continue
        frame, command, x, y, z, params = items[seq]
        answers = bench.say(
            common.MAVLink_mission_item_int_message(1, 1, seq, frame, command, 0, 1, *params, x, y, z, kind)
        )
    raise AssertionError("the upload did not end")


NONE = (0.0, 0.0, 0.0, math.nan)


def square() -> list[tuple[int, int, int, int, float, tuple[float, ...]]]:
    corners = [(6, 16, *degrees(east, north), 25.0, NONE) for east, north in ((80, 0), (80, 60), (0, 60))]
    return [(6, TAKEOFF, 0, 0, 20.0, NONE), *corners, (2, HOME, 0, 0, 0.0, NONE)]


def test_an_uploaded_mission_is_downloaded_as_it_was() -> None:
    bench = Bench()
    items = square()
    assert upload(bench, items) == 0
    (count,) = bench.say(common.MAVLink_mission_request_list_message(1, 1))
    assert count.count == len(items)
    for seq, item in enumerate(items):
        (answer,) = bench.say(common.MAVLink_mission_request_int_message(1, 1, seq))
        assert (answer.frame, answer.command, answer.x, answer.y, answer.z) == item[:5]
        assert answer.seq == seq
    (answer,) = bench.say(common.MAVLink_mission_request_int_message(1, 1, len(items)))
    assert (answer.get_type(), answer.type) == ("MISSION_ACK", common.MAV_MISSION_INVALID_SEQUENCE)
    (old,) = bench.say(common.MAVLink_mission_request_message(1, 1, 1))
    assert old.get_type() == "MISSION_ITEM"
    assert old.x == pytest.approx(items[1][2] / 1e7, abs=1e-5)


def test_an_uploaded_mission_is_flown_item_by_item_and_reported() -> None:
    bench = Bench()
    upload(bench, square())
    bench.command(ARM, 1)
    assert bench.command(START) == ACCEPTED
    assert bench.flown.mode is Mode.MISSION
    corners = {}
    for _ in range(600):
        bench.run(0.2)
        for reached in bench.told("MISSION_ITEM_REACHED"):
            corners.setdefault(reached.seq, bench.position)
        if bench.flown.on_ground and len(corners) > 1:
            break
    assert [*corners] == [0, 1, 2, 3, 4]
    assert corners[1] == pytest.approx((80, 0, 25), abs=3.5)
    assert corners[2] == pytest.approx((80, 60, 25), abs=3.5)
    assert corners[3] == pytest.approx((0, 60, 25), abs=3.5)
    assert bench.position == pytest.approx((0, 0, 0), abs=3.5)


def test_a_mission_takes_its_speed_back_by_minus_two() -> None:
    bench = Bench()
    first, *others = square()
    speeds = [(2, SPEED, 0, 0, 0.0, (1.0, speed_m_s, -1.0, 0.0)) for speed_m_s in (4.0, -2.0)]
    assert upload(bench, [first, speeds[0], others[0], speeds[1], *others[1:]]) == 0
    bench.command(ARM, 1)
    bench.command(START)
    bench.run(60)
    flown = {round(course.position.north): course.speed_m_s for course in bench.courses if course.position.up == 25.0}
    assert flown == {0: 4.0, 60: 10.0}


def test_a_lost_item_is_asked_for_again() -> None:
    bench = Bench()
    assert upload(bench, square(), lose=2) == 0


def test_an_item_that_comes_twice_is_taken_once() -> None:
    bench = Bench()
    items = square()
    bench.say(common.MAVLink_mission_count_message(1, 1, len(items), 0))
    for seq in (0, 1, 1, 0, 2, 3, 2, 4):
        frame, command, x, y, z, params = items[seq]
        answers = bench.say(
            common.MAVLink_mission_item_int_message(1, 1, seq, frame, command, 0, 1, *params, x, y, z, 0)
        )
    assert [answer.type for answer in answers] == [0]
    (count,) = bench.say(common.MAVLink_mission_request_list_message(1, 1))
    assert count.count == len(items)
    (third,) = bench.say(common.MAVLink_mission_request_int_message(1, 1, 2))
    assert (third.x, third.y) == items[2][2:4]


def test_whoever_missed_that_an_upload_was_accepted_is_told_so_again() -> None:
    bench = Bench()
    items = square()
    assert upload(bench, items) == 0
    frame, command, x, y, z, params = items[-1]
    last = common.MAVLink_mission_item_int_message(1, 1, len(items) - 1, frame, command, 0, 1, *params, x, y, z, 0)
    assert [(answer.get_type(), answer.type) for answer in bench.say(last)] == [("MISSION_ACK", 0)]
    assert [answer.type for answer in bench.say(last, sender=(254, 190))] == [common.MAV_MISSION_INVALID_SEQUENCE]


@pytest.mark.parametrize("ends", ["refused", "given up", "cleared"])
def test_the_last_item_of_an_upload_that_was_not_accepted_is_not_taken_for_that_of_one_before(ends: str) -> None:
    """The acknowledgment was lost, and the ground station says the last item again."""
    bench = Bench()
    items = square()
    assert upload(bench, items) == 0
    expected = common.MAV_MISSION_INVALID_SEQUENCE
    frame, command, x, y, z, params = items[-1]
    if ends == "refused":
        command = 4000
        assert upload(bench, [*items[:-1], (frame, command, x, y, z, params)]) == common.MAV_MISSION_UNSUPPORTED
        expected = common.MAV_MISSION_UNSUPPORTED
    elif ends == "given up":
        bench.say(common.MAVLink_mission_count_message(1, 1, len(items), 0))
        bench.run(12)
    else:
        bench.say(common.MAVLink_mission_clear_all_message(1, 1, 0))
    last = common.MAVLink_mission_item_int_message(1, 1, len(items) - 1, frame, command, 0, 1, *params, x, y, z, 0)
    assert [(answer.get_type(), answer.type) for answer in bench.say(last)] == [("MISSION_ACK", expected)]


def test_an_upload_that_breaks_off_leaves_the_old_mission() -> None:
    bench = Bench()
    upload(bench, square())
    bench.say(common.MAVLink_mission_count_message(1, 1, 2, 0))
    bench.run(12)
    assert [ack.type for ack in bench.told("MISSION_ACK")][-1] == common.MAV_MISSION_OPERATION_CANCELLED
    (count,) = bench.say(common.MAVLink_mission_request_list_message(1, 1))
    assert count.count == 5


@pytest.mark.parametrize(
    ("item", "result"),
    [
        ((6, 4000, 0, 0, 0.0, NONE), common.MAV_MISSION_UNSUPPORTED),
        ((10, 16, *degrees(0, 0), 20.0, NONE), common.MAV_MISSION_UNSUPPORTED_FRAME),
        ((6, 16, 2_000_000_000, 0, 20.0, NONE), common.MAV_MISSION_INVALID_PARAM5_X),
        ((6, 16, 0, 2_000_000_000, 20.0, NONE), common.MAV_MISSION_INVALID_PARAM6_Y),
        ((6, 16, *degrees(0, 900), 20.0, NONE), common.MAV_MISSION_INVALID_PARAM5_X),
        ((6, 16, *degrees(900, 0), 20.0, NONE), common.MAV_MISSION_INVALID_PARAM6_Y),
        ((6, 16, *degrees(0, 0), 2000.0, NONE), common.MAV_MISSION_INVALID_PARAM7),
        ((6, 16, *degrees(0, 0), math.nan, NONE), common.MAV_MISSION_INVALID_PARAM7),
        ((6, 16, *degrees(100, 0), 20.0, NONE), common.MAV_MISSION_INVALID),
        ((2, 177, 0, 0, 0.0, (math.nan, 1, 0, 0)), common.MAV_MISSION_INVALID_PARAM1),
        ((2, 177, 0, 0, 0.0, (math.inf, 1, 0, 0)), common.MAV_MISSION_INVALID_PARAM1),
        ((2, SPEED, 0, 0, 0.0, (common.SPEED_TYPE_CLIMB_SPEED, 2, 0, 0)), common.MAV_MISSION_INVALID_PARAM1),
    ],
)
def test_a_mission_that_cannot_be_flown_is_refused_with_its_reason(item: object, result: int) -> None:
    bench = Bench()
    upload(bench, square())
    fenced(bench)
    assert upload(bench, [item]) == result  # type: ignore[list-item]
    (count,) = bench.say(common.MAVLink_mission_request_list_message(1, 1))
    assert count.count == 5


def test_a_second_ground_station_waits_for_the_first_ones_upload() -> None:
    bench = Bench()
    bench.say(common.MAVLink_mission_count_message(1, 1, 2, 0))
    (answer,) = bench.say(common.MAVLink_mission_count_message(1, 1, 2, 0), sender=(254, 190))
    assert (answer.type, answer.target_system) == (common.MAV_MISSION_DENIED, 254)


def test_a_jump_is_made_as_often_as_it_says() -> None:
    bench = Bench()
    a, b = degrees(20, 0), degrees(0, 20)
    items = [
        (6, TAKEOFF, 0, 0, 10.0, NONE), (6, 16, *a, 10.0, NONE), (6, 16, *b, 10.0, NONE),
        (2, 177, 0, 0, 0.0, (1, 2, 0, 0)),
    ]  # fmt: skip
    assert upload(bench, items) == 0
    bench.command(ARM, 1)
    bench.command(START)
    bench.run(60)
    assert [reached.seq for reached in bench.told("MISSION_ITEM_REACHED")] == [0, 1, 2, 3, 1, 2, 3, 1, 2, 3]
    assert bench.flown.mode is Mode.HOLD


def test_a_pause_holds_and_a_continuation_goes_on_from_there() -> None:
    bench = Bench()
    upload(bench, square())
    bench.command(ARM, 1)
    bench.command(START)
    bench.run(15)
    at = bench.flown.mission_at
    assert bench.command(PAUSE, 0) == ACCEPTED
    here = bench.position
    bench.run(5)
    assert bench.position == pytest.approx(here, abs=2.5)
    assert bench.command(PAUSE, 1) == ACCEPTED
    assert bench.flown.mission_at == at
    bench.run(40)
    assert bench.flown.mission_at > at


def test_who_has_a_task_of_the_swarm_goes_on_with_it_when_its_mission_starts() -> None:
    bench = Bench(scenario(mobility={"model": "random_waypoint", "speed_m_s": 5}, nodes={"count": 2}), at=Enu(0, 0, 50))
    bench.run(3)
    assert bench.flown.mode is Mode.MISSION
    assert bench.control.permits(Course(Enu(0, 0, 0), 1.0), bench.now_ns)
    assert bench.command(PAUSE, 0) == ACCEPTED
    assert not bench.control.permits(Course(Enu(0, 0, 0), 1.0), bench.now_ns)
    assert bench.command(START) == ACCEPTED
    assert bench.control.permits(Course(Enu(0, 0, 0), 1.0), bench.now_ns)
    assert bench.courses[-1].speed_m_s == 0  # back to where the formation wants it


def test_without_a_ground_station_nothing_is_flown_and_nothing_said() -> None:
    bench = Bench()
    bench.run(20, heartbeats=False)
    assert not bench.courses
    assert not bench.heard
    assert bench.control.next_wake_ns() is None


def test_what_an_operator_must_know_is_said_once_somebody_listens() -> None:
    from fanet_mw.trace import Confirmed, Posed, Warned

    bench = Bench()
    bench.control.on_record(Confirmed(0, 1, 9, 1.0, 2.0), 0)
    assert not bench.heard
    bench.run(2)
    bench.control.on_record(Confirmed(0, 1, 9, 1.0, 2.0), bench.now_ns)
    bench.control.on_record(Posed(0, 1, 1.0, 2.0, 3.0), bench.now_ns)
    bench.control.on_record(Warned(0, 1, 2, 5), bench.now_ns)
    said = [(text.severity, text.text) for text in bench.told("STATUSTEXT")]
    assert said == [(5, "Survivor 9 confirmed"), (5, "Collision warning: UAV 2")]


def test_survivors_are_shown_in_turn_as_something_on_the_surface_until_they_are_refuted() -> None:
    from fanet_mw.trace import Confirmed, PlacedInside, Refuted

    bench = Bench()

    def shown(seconds: int) -> list[tuple[str, int, int]]:
        before = bench.now_ns
        bench.run(seconds)
        frames = [bench.streams.telemetry(t_ns) for t_ns in range(before, bench.now_ns, S // 10)]
        told = [one for one in mavlink.decode(b"".join(frames)) if one.get_type() == "ADSB_VEHICLE"]
        assert all(abs(one.altitude) < 5 and one.emitter_type == 17 and one.tslc == 0 for one in told)
        return [(one.callsign, one.lat, one.lon) for one in told]

    assert shown(3) == []
    bench.control.on_record(Confirmed(0, 1, 9, 120.0, -40.0), bench.now_ns)
    bench.control.on_record(PlacedInside(0, 1, 12, 0.0, 60.0), bench.now_ns)
    nine, twelve = ("FOUND9", *degrees(120.0, -40.0)), ("FOUND12", *degrees(0.0, 60.0))
    assert shown(6)[:4] in ([nine, twelve] * 2, [twelve, nine] * 2)
    bench.control.on_record(Refuted(0, 1, 9, 120.0, -40.0), bench.now_ns)
    assert set(shown(4)) == {twelve}


# --- parameters, files, and what else is asked --------------------------------------------------------------------


def test_parameters_are_listed_read_written_and_bounded() -> None:
    bench = Bench()
    listed = bench.say(common.MAVLink_param_request_list_message(1, 1))
    assert [value.param_index for value in listed] == [*range(len(listed))]
    assert {value.param_count for value in listed} == {len(listed)}
    assert [value.param_id for value in listed] == sorted(value.param_id for value in listed)
    (value,) = bench.say(common.MAVLink_param_request_read_message(1, 1, b"NAV_ACC_RAD", -1))
    assert value.param_value == 3.0
    (value,) = bench.say(common.MAVLink_param_set_message(1, 1, b"NAV_ACC_RAD", 7.0, 9))
    assert value.param_value == 7.0
    for wrong in (-1.0, math.nan, math.inf, 1e9):
        error, value = bench.say(common.MAVLink_param_set_message(1, 1, b"NAV_ACC_RAD", wrong, 9))
        assert error.error == common.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
        assert value.param_value == 7.0
    error, value = bench.say(common.MAVLink_param_set_message(1, 1, b"NAV_ACC_RAD", 5.0, common.MAV_PARAM_TYPE_INT32))
    assert (error.get_type(), error.error, value.param_value) == ("PARAM_ERROR", 7, 7.0)
    (error,) = bench.say(common.MAVLink_param_request_read_message(1, 1, b"SYS_AUTOSTART", -1))
    assert error.get_type() == "PARAM_ERROR"
    (error,) = bench.say(common.MAVLink_param_request_read_message(1, 1, b"", 99))
    assert error.get_type() == "PARAM_ERROR"


def test_an_operator_changes_when_a_search_ends_within_bounds() -> None:
    from agents.ground_control.application import GroundControl
    from agents.mission.flight.search_limits import SearchLimits

    chosen = scenario(
        nodes={"count": 12, "altitude_m": 65}, world={"area_m": 600}, sensors={"battery_hz": 1},
        mission={"search": "lines", "survivors": 1, "reserve_charge": 0.25},
    )  # fmt: skip
    limits = SearchLimits(chosen)
    bench = Bench(chosen)
    bench.control = GroundControl(
        chosen, bench.node, bench.streams, position=bench.position, on_mission_key=limits.change
    )
    bench.control.start(bench, 0)  # type: ignore[arg-type]
    listed = {value.param_id: value.param_value for value in bench.say(common.MAVLink_param_request_list_message(1, 1))}
    assert (listed["SRCH_RESERVE"], listed["SRCH_LINK_T"], listed["SRCH_SWEEPS"]) == (0.25, 0.0, 0.0)
    for name, value in ((b"SRCH_RESERVE", 0.5), (b"SRCH_LINK_T", 30.0), (b"SRCH_SWEEPS", 2.0)):
        bench.say(common.MAVLink_param_set_message(1, 1, name, value, 9))
    assert (limits.reserve, limits.lost_link_ns, limits.sweeps) == (0.5, 30 * S, 2)
    error, _ = bench.say(common.MAVLink_param_set_message(1, 1, b"SRCH_RESERVE", 1.5, 9))
    assert error.error == common.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
    assert limits.reserve == 0.5


@pytest.mark.parametrize(
    ("opcode", "answer", "why"), [(4, 129, 10), (3, 129, 10), (7, 129, 7), (2, 128, 0), (1, 128, 0)]
)
def test_files_are_refused_and_never_met_with_silence(opcode: int, answer: int, why: int) -> None:
    bench = Bench()
    payload = [5, 0, 9, opcode, *[0] * 247]
    (said,) = bench.say(common.MAVLink_file_transfer_protocol_message(0, 1, 1, payload))
    assert (said.target_system, said.target_component) == GCS
    assert (said.payload[0], said.payload[2], said.payload[3], said.payload[5]) == (6, 9, answer, opcode)
    assert said.payload[12] == why


def test_a_ping_and_a_question_for_the_time_are_answered() -> None:
    bench = Bench()
    bench.run(3)
    (pong,) = bench.say(common.MAVLink_ping_message(7, 8, 0, 0))
    assert (pong.time_usec, pong.seq, pong.target_system) == (7, 8, 255)
    (time,) = bench.say(common.MAVLink_timesync_message(0, 4711))
    assert (time.tc1, time.ts1) == (bench.now_ns, 4711)
    assert bench.now_ns == 3 * S


def test_messages_are_sent_when_asked_for_and_as_often_as_asked() -> None:
    bench = Bench()
    answers = bench.say(common.MAVLink_command_long_message(1, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0))
    assert [answer.get_type() for answer in answers] == ["AUTOPILOT_VERSION", "COMMAND_ACK"]
    assert bench.command(512, 259) == DENIED  # CAMERA_INFORMATION
    assert bench.command(511, 30, 100_000) == ACCEPTED
    answers = bench.say(common.MAVLink_command_long_message(1, 1, 510, 0, 30, 0, 0, 0, 0, 0, 0))
    assert answers[0].interval_us == 100_000
    count = 0
    for step in range(200):
        told = mavlink.decode(bench.streams.telemetry(bench.now_ns + step * 10_000_000))
        count += sum(message.get_type() == "ATTITUDE" for message in told)
    assert count == pytest.approx(20, abs=1)
    assert bench.command(511, 30, -1) == ACCEPTED
    assert bench.streams.interval_ns(30) == 0


@pytest.mark.parametrize("interval_us", [1.8e9, 2.2e9, 3.6e9])
def test_an_interval_that_no_answer_could_tell_is_denied(interval_us: float) -> None:
    bench = Bench()
    assert bench.command(511, 30, interval_us) == (ACCEPTED if interval_us < 2**31 else DENIED)
    answers = bench.say(common.MAVLink_command_long_message(1, 1, 510, 0, 30, 0, 0, 0, 0, 0, 0))
    assert [answer.get_type() for answer in answers] == ["MESSAGE_INTERVAL", "COMMAND_ACK"]


def test_answers_and_telemetry_are_numbered_without_a_gap() -> None:
    bench = Bench()
    bench.airborne()
    upload(bench, square())
    assert {(later - number) % 256 for number, later in pairwise(bench.numbers)} == {1}


def test_a_ground_station_that_floods_takes_no_more_than_its_share() -> None:
    bench = Bench()
    bench.say(*[common.MAVLink_ping_message(0, seq, 0, 0) for seq in range(1000)])
    assert len(bench.told("PING")) == 200
    assert bench.control.report()["operator_flooded"] == 800
    bench.run(1)
    assert bench.say(common.MAVLink_ping_message(0, 1, 0, 0))


def test_what_is_for_another_system_or_component_is_not_answered() -> None:
    bench = Bench()
    assert not bench.say(common.MAVLink_command_long_message(2, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0))
    assert not bench.say(common.MAVLink_command_long_message(1, 100, ARM, 0, 1, 0, 0, 0, 0, 0, 0))
    assert not bench.flown.armed


@pytest.mark.parametrize("least_ns", [None, 20 * S])
def test_telemetry_that_the_network_refused_is_as_frequent_again_once_it_is_taken(least_ns: int | None) -> None:
    bench = Bench(scenario(ground={"at_m": [0, 0]}))
    control, post = bench.control, bench.scenario.post
    assert post is not None
    heartbeat = bytes(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(common.MAVLink(None, *GCS)))

    def intervals_s(seconds: int) -> list[float]:
        before = len(bench.reports_ns)
        for _ in range(seconds):
            control.on_message(
                Received(post, bench.node, 1, bench.now_ns, 1, heartbeat, content=heartbeat), bench.now_ns
            )
            bench.run(1, heartbeats=False)
        return [(later - at) / S for at, later in pairwise(bench.reports_ns[before:])]

    usual_s = intervals_s(30)[-1]
    for _ in range(4):
        status = Status(1, Fate.REFUSED, bench.now_ns, interval_ns=least_ns)
        control.on_status(status, bench.now_ns)
    assert intervals_s(100)[-1] >= 16 * usual_s
    assert intervals_s(125)[-1] >= 8 * usual_s, "two minutes after the refusal it is tried only twice as often"
    assert intervals_s(700)[-1] == usual_s


def setpoint(bench: Bench, *, frame: int, mask: int, place: Enu = STILL, moves: Enu = STILL) -> None:
    bench.say(common.MAVLink_set_position_target_local_ned_message(0, 1, 1, frame, mask, *place, *moves, 0, 0, 0, 0, 0))


@pytest.mark.parametrize("frame", [common.MAV_FRAME_BODY_NED, common.MAV_FRAME_BODY_OFFSET_NED, 12, 0, 255])
def test_a_velocity_over_the_nose_is_not_flown_to_the_north(frame: int) -> None:
    bench = Bench().airborne()
    bench.say(common.MAVLink_set_mode_message(1, 1, number_of(Mode.GUIDED)))
    flown = len(bench.courses)
    for _ in range(3):
        setpoint(bench, frame=frame, mask=0b110111000111, moves=Enu(5, 0, 0))
    assert len(bench.courses) == flown
    assert bench.control.report()["operator_senseless_setpoints"] == 3
    said = [text.text for text in bench.told("STATUSTEXT") if "frame" in text.text]
    assert said == [f"Setpoint in frame {frame}: not flown"], "once, not with each setpoint"


def test_of_a_setpoint_that_is_ignored_in_part_nothing_is_flown() -> None:
    bench = Bench().airborne()
    bench.say(common.MAVLink_set_mode_message(1, 1, number_of(Mode.GUIDED)))
    flown = len(bench.courses)
    setpoint(bench, frame=1, mask=0b110111000011, place=Enu(0, 0, -30), moves=Enu(5, 0, 0))  # a height and a velocity
    setpoint(bench, frame=1, mask=0b110111100111, moves=Enu(5, 0, 9))
    assert len(bench.courses) == flown
    assert bench.control.report()["operator_senseless_setpoints"] == 2


def test_a_velocity_is_no_greater_than_an_operator_may_ask_for() -> None:
    bench = Bench().airborne()
    bench.say(common.MAVLink_set_mode_message(1, 1, number_of(Mode.GUIDED)))
    velocity(bench, 30, 40)
    assert bench.courses[-1].velocity == pytest.approx((16, 12, 0))


def test_who_was_refused_everything_has_taken_the_uav_from_nobody() -> None:
    bench = Bench()
    elsewhere = Course(Enu(10, 0, 20), 5.0)
    for number in (common.MAV_CMD_REQUEST_PROTOCOL_VERSION, TAKEOFF, REPOSITION, MODE):
        assert bench.command(number, 1, 99, 99) != ACCEPTED
    bench.say(common.MAVLink_set_mode_message(1, 1, 77))
    velocity(bench, 1, 0)
    assert bench.control.permits(elsewhere, bench.now_ns)
    bench.airborne()
    assert not bench.control.permits(elsewhere, bench.now_ns)


def test_an_operator_who_only_watched_and_goes_takes_the_uav_from_nobody() -> None:
    bench = Bench(scenario(nodes={"count": 2}), at=Enu(0, 0, 50))
    bench.run(2)
    bench.run(20, heartbeats=False)
    assert not bench.courses
    assert bench.control.permits(Course(Enu(10, 0, 50), 5.0), bench.now_ns)


def test_beyond_a_fence_nobody_but_the_operators_side_flies_though_it_was_never_commanded() -> None:
    bench = Bench(scenario(mobility={"model": "random_waypoint", "speed_m_s": 5}, nodes={"count": 2}), at=Enu(0, 0, 50))
    corners = [degrees(east, north) for east, north in ((100, 100), (200, 100), (200, 200), (100, 200))]
    upload(bench, [(0, 5001, x, y, 0.0, (4, 0, 0, 0)) for x, y in corners], kind=1)
    bench.run(2)
    assert bench.flown.mode is Mode.HOLD
    assert not bench.control.permits(Course(Enu(0, 0, 50), 5.0), bench.now_ns)


@pytest.mark.parametrize("delay", [common.MAV_CMD_NAV_DELAY, common.MAV_CMD_CONDITION_DELAY])
def test_a_mission_that_begins_with_a_delay_takes_off_after_it(delay: int) -> None:
    bench = Bench()
    assert upload(bench, [(2, delay, 0, 0, 0.0, (5, 0, 0, 0)), (6, TAKEOFF, 0, 0, 20.0, NONE)]) == ACCEPTED
    bench.command(ARM, 1)
    assert bench.command(START) == ACCEPTED
    bench.run(4)
    assert not bench.courses
    bench.run(12)
    assert bench.position.up == pytest.approx(20, abs=3)


def test_who_is_disarmed_while_its_mission_waits_does_not_take_off() -> None:
    bench = Bench()
    upload(bench, [(2, common.MAV_CMD_NAV_DELAY, 0, 0, 0.0, (5, 0, 0, 0)), (6, TAKEOFF, 0, 0, 20.0, NONE)])
    bench.command(ARM, 1)
    bench.command(START)
    bench.run(2)
    assert bench.command(ARM, 0) == ACCEPTED
    bench.run(10)
    assert not bench.courses
    assert bench.flown.mode is Mode.HOLD


def test_a_mission_that_returns_from_the_ground_is_over_at_once() -> None:
    bench = Bench()
    upload(bench, [(2, HOME, 0, 0, 0.0, NONE)])
    bench.command(ARM, 1)
    bench.command(START)
    bench.run(3)
    assert bench.flown.mode is Mode.HOLD
    assert len(bench.told("STATUSTEXT")) == 1


def test_another_item_that_is_set_while_a_mission_lands_is_flown() -> None:
    bench = Bench()
    away = degrees(80, 0)
    upload(bench, [(6, TAKEOFF, 0, 0, 20.0, NONE), (6, 16, *away, 20.0, NONE), (6, LAND, *degrees(0, 0), 0.0, NONE)])
    bench.command(ARM, 1)
    bench.command(START)
    while not bench.courses[-1:] or not bench.courses[-1].land:
        bench.run(1)
    bench.run(3)
    bench.say(common.MAVLink_mission_set_current_message(1, 1, 1))
    bench.run(6)
    assert not bench.courses[-1].land
    assert bench.position.east > 30
    bench.run(60)
    assert bench.flown.on_ground
    assert [reached.seq for reached in bench.told("MISSION_ITEM_REACHED")] == [0, 1, 1, 2]


def test_who_is_told_to_hold_while_it_leaves_the_ground_climbs_no_farther() -> None:
    bench = Bench()
    bench.command(ARM, 1)
    bench.command(TAKEOFF, 0, 0, 0, math.nan, math.nan, math.nan, 100)
    bench.run(0.6)
    assert bench.flown.on_ground
    assert bench.command(PAUSE, 0) == ACCEPTED
    bench.run(10)
    assert bench.position.up < 10


def test_a_return_higher_than_any_uav_flies_still_comes_home() -> None:
    bench = Bench(at=Enu(0, 0, 0)).airborne()
    answer = bench.say(common.MAVLink_param_set_message(1, 1, b"RTL_RETURN_ALT", 1500.0, 9))
    assert [one.get_type() for one in answer] == ["PARAM_ERROR", "PARAM_VALUE"]
    high = scenario(mobility={"model": "onboard", "return_height_m": 1000, "return_step_m": 100})
    assert all(setting.least <= setting.default <= setting.most for setting in settings_of(high, NodeId(2)))
    hill = Bench(at=Enu(0, 0, 300)).airborne(320)
    assert go_to(hill, 100, 0, 320) == ACCEPTED
    hill.run(15)
    hill.say(common.MAVLink_param_set_message(1, 1, b"RTL_RETURN_ALT", 900.0, 9))
    assert hill.command(HOME) == ACCEPTED
    assert max(course.position.up for course in hill.courses) <= 1000


def test_how_near_a_waypoint_counts_as_reached_moves_no_landing_and_lowers_no_return() -> None:
    bench = Bench().airborne()
    bench.say(common.MAVLink_param_set_message(1, 1, b"NAV_ACC_RAD", 100.0, 9))
    assert go_to(bench, 90, 0, 20) == ACCEPTED
    bench.run(15)
    assert bench.command(HOME) == ACCEPTED
    assert not bench.courses[-1].land
    assert bench.courses[-1].position.up == pytest.approx(100)
    bench.run(140)
    assert bench.flown.on_ground
    assert bench.position == pytest.approx((0, 0, 0), abs=3.5)


def test_a_mission_lands_at_its_place_however_near_counts_as_reached() -> None:
    bench = Bench()
    bench.say(common.MAVLink_param_set_message(1, 1, b"NAV_ACC_RAD", 100.0, 9))
    upload(bench, [(6, TAKEOFF, 0, 0, 20.0, NONE), (6, LAND, *degrees(80, 0), 0.0, NONE)])
    bench.command(ARM, 1)
    bench.command(START)
    while bench.position.east < 1:
        bench.run(0.2)
    assert bench.position.up > 15, "a take-off is not over near the ground, either"
    bench.run(60)
    assert bench.position == pytest.approx((80, 0, 0), abs=3.5)


def test_over_the_air_no_stream_changes_whichever_message_asks() -> None:
    bench = Bench(scenario(ground={"at_m": [0, 0]}))
    mav = common.MAVLink(None, srcSystem=255, srcComponent=190)
    asked = common.MAVLink_request_data_stream_message(1, 1, common.MAV_DATA_STREAM_ALL, 20, 1)
    frame, post = bytes(asked.pack(mav)), bench.scenario.post
    assert post is not None
    bench.control.on_message(Received(post, bench.node, 2, 0, 1, frame, content=frame), 0)
    assert bench.streams.interval_ns(common.MAVLINK_MSG_ID_ATTITUDE) != S // 20


def test_a_receiver_that_gives_no_more_fixes_has_none() -> None:
    bench = Bench()
    bench.run(2)

    def fix_type() -> int:
        bench.command(common.MAV_CMD_REQUEST_MESSAGE, common.MAVLINK_MSG_ID_GPS_RAW_INT)
        return int(bench.told("GPS_RAW_INT")[-1].fix_type)

    assert fix_type() == 3
    bench.now_ns += 10 * S
    assert fix_type() == 1


@pytest.mark.parametrize("on_ground", [True, False])
@pytest.mark.parametrize("place", [Enu(300, 0, 22), Enu(5, 0, 95)])
def test_a_computer_that_starts_again_in_flight_takes_no_height_for_an_error_of_gps(
    place: Enu, *, on_ground: bool
) -> None:
    start = Enu(0, 0, 0 if on_ground else 20)
    bench = Bench(scenario(nodes={"count": 2, "on_ground": on_ground, "altitude_m": 20}), at=start)
    bench.position = place
    bench.run(10)
    assert not bench.flown.on_ground
    assert bench.flown.armed
    bench.command(common.MAV_CMD_REQUEST_MESSAGE, common.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
    assert bench.told("LOCAL_POSITION_NED")[-1].z == pytest.approx(-place.up, abs=0.1)


def fenced(bench: Bench) -> Bench:
    corners = [degrees(east, north) for east, north in ((-50, -50), (50, -50), (50, 50), (-50, 50))]
    assert upload(bench, [(0, 5001, x, y, 0.0, (4, 0, 0, 0)) for x, y in corners], kind=1) == ACCEPTED
    return bench


def fixes(bench: Bench, *east_m: float) -> None:
    """Positions along a line to the east, as the receiver has them."""
    for east in east_m:
        bench.now_ns += S // 5
        bench.control.on_fix(Gps(bench.now_ns, Enu(east, 0, 20), Enu(0, 0, 0)), bench.now_ns)


@pytest.mark.parametrize(("number", "mode"), [(HOME, Mode.RETURN), (LAND, Mode.LAND), (REPOSITION, Mode.HOLD)])
def test_who_holds_at_the_edge_of_a_fence_may_leave_it_whatever_the_noise_of_fixes(number: int, mode: Mode) -> None:
    bench = fenced(Bench().airborne())
    fixes(bench, 49, 51)
    assert bench.flown.mode is Mode.HOLD
    fixes(bench, 49.8, 50.1, 49.9)
    lat, lon = degrees(0, 0)
    assert bench.command(number, -1, 1, 0, math.nan, lat / 1e7, lon / 1e7, 20) == ACCEPTED
    flown = len(bench.courses)
    fixes(bench, 50.1, 49.9, 50.2, 49.5, 50.1)
    assert bench.flown.mode is mode
    assert len(bench.courses) == flown
    fixes(bench, 40)
    assert not bench.flown.beyond
    if mode is Mode.HOLD:
        fixes(bench, 51)
        assert len(bench.courses) > flown, "whoever was inside and leaves again holds again"


@pytest.mark.parametrize(("action", "mode"), [(2, Mode.RETURN), (3, Mode.RETURN), (5, Mode.LAND)])
def test_a_return_across_a_fence_is_no_less_than_what_the_fence_asks_for(action: int, mode: Mode) -> None:
    bench = fenced(Bench().airborne())
    bench.say(common.MAVLink_param_set_message(1, 1, b"GF_ACTION", float(action), 9))
    fixes(bench, 40)
    bench.command(HOME)
    fixes(bench, 51)
    assert bench.flown.mode is mode


def test_another_fence_is_looked_at_anew() -> None:
    bench = fenced(Bench().airborne())
    fixes(bench, 49, 51)
    told = len(bench.told("STATUSTEXT"))
    fenced(bench)
    fixes(bench, 51)
    assert len(bench.told("STATUSTEXT")) == told + 1


@pytest.mark.parametrize("drift_m", [0.01, -0.01])
def test_a_barometer_that_drifts_lets_nobody_who_has_landed_take_off(drift_m: float) -> None:
    bench = Bench().airborne()
    bench.command(LAND)
    bench.run(20 / 1.5 + 4)
    flown = len(bench.courses)
    for fix in range(600):
        bench.now_ns += S // 5
        bench.control.on_fix(Gps(bench.now_ns, Enu(0, 0, drift_m * fix), Enu(0, 0, 0.1)), bench.now_ns)
    assert bench.flown.on_ground
    assert not bench.flown.armed
    bench.run(15, heartbeats=False)
    assert len(bench.courses) == flown, "an operator who is lost lifts nobody from the ground"


def test_who_climbs_has_taken_off_whoever_asked_for_it() -> None:
    bench = Bench()
    bench.run(2)
    for up in (1.0, 2.0, 3.0):
        bench.now_ns += S // 5
        bench.control.on_fix(Gps(bench.now_ns, Enu(0, 0, up), Enu(0, 0, 2.0)), bench.now_ns)
    assert not bench.flown.on_ground
    assert bench.flown.armed


def test_a_second_take_off_of_a_mission_climbs_on() -> None:
    bench = Bench()
    upload(bench, [(6, TAKEOFF, 0, 0, 10.0, NONE), (2, 93, 0, 0, 0.0, (2, 0, 0, 0)), (6, TAKEOFF, 0, 0, 30.0, NONE)])
    bench.command(ARM, 1)
    bench.command(START)
    bench.run(20)
    assert bench.flown.mode is Mode.HOLD
    assert bench.position.up == pytest.approx(30, abs=3.5)


def test_who_stands_elsewhere_than_it_was_told_stands_and_returns_there() -> None:
    """Simulators of autopilots begin where they like, and who starts a UAV in the field need not say where (`--at`)."""
    bench = Bench()
    bench.position = Enu(80, -40, 0.0)
    bench.run(5)
    assert bench.flown.on_ground
    assert not bench.flown.armed
    assert bench.flown.home == Enu(80, -40, 0)
    bench.airborne()
    assert go_to(bench, 0, 0, 20) == ACCEPTED
    bench.run(15)
    assert bench.command(HOME) == ACCEPTED
    bench.run(140)
    assert bench.flown.on_ground
    assert bench.position == pytest.approx((80, -40, 0), abs=3.5)


@pytest.mark.parametrize("kind", [0, 1])
def test_a_part_of_a_plan_is_refused_and_never_met_with_silence(kind: int) -> None:
    """MAVProxy changes a single item by `wp update` in this way."""
    bench = Bench()
    upload(bench, square())
    for message in (
        common.MAVLink_mission_write_partial_list_message(1, 1, 1, 2, kind),
        common.MAVLink_mission_request_partial_list_message(1, 1, 1, 2, kind),
    ):
        (answer,) = bench.say(message)
        assert (answer.get_type(), answer.type) == ("MISSION_ACK", common.MAV_MISSION_UNSUPPORTED)
        assert answer.mission_type == kind


def test_all_that_a_uav_answers_may_come_over_the_air() -> None:
    understood = {*GroundControl._HANDLERS, *PlanTransfer._HANDLERS}
    ids = {number for number, message in common.mavlink_map.items() if message.msgname in understood}
    assert ids == OVER_AIR
