"""The flight controller as seen over MAVLink: rates, attitude, battery."""

import math
from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.applications.telemetry_streams import DRAG_PER_M, DRAG_PER_S, GRAVITY_M_S2, MAX_TILT, TelemetryStreams
from fanet_mw import mavlink
from fanet_mw.bus.messages import Battery, FlightState, Gps, WindEstimate
from fanet_mw.mavlink import Attitude, common
from fanet_mw.units import MS, Enu, NodeId, S
from sim.world.engines.rotors.rigid_body import Rotors
from sim.world.engines.rotors.vehicle_types import IRIS

NODE = NodeId(3)
START = Enu(100.0, 200.0, 50.0)
STILL = Enu(0.0, 0.0, 0.0)


def make(*, telemetry_hz: float = 1.0, node: int = NODE) -> TelemetryStreams:
    return TelemetryStreams(NodeId(node), position=START, telemetry_hz=telemetry_hz)


def run(streams: TelemetryStreams, *, until_ns: int) -> list[tuple[int, Any]]:
    """Every message with its instant, woken exactly when due."""
    heard = []
    while (due_ns := streams.next_due_ns()) is not None and due_ns < until_ns:
        heard += [(due_ns, message) for message in mavlink.decode(streams.telemetry(due_ns))]
    return heard


def fly(streams: TelemetryStreams, *velocities: Enu, interval_ns: int = 200 * MS) -> None:
    for count, velocity in enumerate(velocities):
        streams.fix(Gps(count * interval_ns, START, velocity))


def latest(streams: TelemetryStreams, name: str, *, now_ns: int = 0) -> Any:
    """The message of that name in telemetry of a moment when everything is due."""
    found = [m for m in mavlink.decode(streams.telemetry(now_ns + 60 * S)) if m.get_type() == name]
    (message,) = found
    return message


def test_what_a_real_flight_controller_says_beats_what_is_inferred_while_it_is_heard() -> None:
    streams = make()
    fly(streams, STILL, Enu(5, 0, 0), Enu(10, 0, 0))
    streams.on_flight(FlightState(400 * MS, 0.1, -0.2, 1.0, 14, 0.8, 1_800_000_000 * S))
    streams.fix(Gps(600 * MS, START, Enu(10, 0, 0)))
    assert streams.attitude == Attitude(0.1, -0.2, 1.0)
    assert streams.yaw == 1.0
    gps, (clock,) = latest(streams, "GPS_RAW_INT"), mavlink.decode(streams.one(2, 1400 * MS) or b"")
    assert (gps.satellites_visible, gps.eph) == (14, 80)
    assert clock.time_unix_usec == 1_800_000_001_000_000
    streams.fix(Gps(4 * S, START, Enu(10, 0, 0)))
    assert streams.yaw == pytest.approx(math.pi / 2)


# --- rates --------------------------------------------------------------------------------------------------------


def test_each_message_comes_at_its_rate() -> None:
    counts = Counter(message.get_type() for _, message in run(make(telemetry_hz=5.0), until_ns=10 * S))
    assert counts == {
        "GLOBAL_POSITION_INT": 50, "HEARTBEAT": 10, "ATTITUDE": 10, "GPS_RAW_INT": 10, "EXTENDED_SYS_STATE": 10,
        "SYS_STATUS": 2, "BATTERY_STATUS": 1, "HOME_POSITION": 1,
    }  # fmt: skip


def test_a_slow_tap_slows_every_message() -> None:
    counts = Counter(message.get_type() for _, message in run(make(telemetry_hz=0.1), until_ns=40 * S))
    assert len(counts) == 8
    assert set(counts.values()) == {4}


def test_no_rate_is_no_telemetry() -> None:
    quiet = make(telemetry_hz=0)
    assert quiet.next_due_ns() is None
    assert quiet.telemetry(100 * S) == b""


def test_before_the_first_instant_nothing_is_due() -> None:
    streams = make()
    due_ns = streams.next_due_ns()
    assert due_ns is not None
    assert streams.telemetry(due_ns - 1) == b""
    assert streams.telemetry(due_ns) != b""


@given(st.integers(0, 100 * S), st.sampled_from([0.5, 1.0, 3.0, 5.0]))
def test_after_telemetry_the_next_is_due_later_however_late_it_was(now_ns: int, telemetry_hz: float) -> None:
    streams = make(telemetry_hz=telemetry_hz)
    counts = Counter(message.get_type() for message in mavlink.decode(streams.telemetry(now_ns)))
    assert max(counts.values(), default=1) == 1
    due_ns = streams.next_due_ns()
    assert due_ns is not None
    assert now_ns < due_ns <= now_ns + S / telemetry_hz


@pytest.mark.parametrize("late_ms", [0, 30, 499, 1730])
def test_telemetry_that_was_late_keeps_its_phase(late_ms: int) -> None:
    streams = make(telemetry_hz=2.0)
    first_ns = streams.next_due_ns()
    assert first_ns is not None
    streams.telemetry(first_ns + late_ms * MS)
    assert streams.next_due_ns() == first_ns + (late_ms // 500 + 1) * 500 * MS


def test_nodes_do_not_all_speak_at_once() -> None:
    dues = [make(node=node).next_due_ns() for node in range(1, 46)]
    assert len(set(dues)) == 45


def test_telemetry_comes_from_the_nodes_system_and_its_flight_controller() -> None:
    sources = {(m.get_srcSystem(), m.get_srcComponent()) for _, m in run(make(node=251), until_ns=2 * S)}
    assert sources == {(1, 1)}


# --- position -----------------------------------------------------------------------------------------------------


def test_a_beacon_is_a_heartbeat_and_where_we_are() -> None:
    streams = make()
    streams.fix(Gps(1 * S, Enu(-5.0, 6.0, 70.0), Enu(1.0, 2.0, -0.5)))
    heartbeat, position = mavlink.decode(streams.beacon_frames(2 * S))
    assert heartbeat.get_type() == "HEARTBEAT"
    heard = mavlink.kinematics(position)
    assert heard.position == pytest.approx((-5.0, 6.0, 70.0), abs=0.01)
    assert heard.velocity == pytest.approx((1.0, 2.0, -0.5), abs=0.01)
    assert heard.t_ms == 2000


def test_until_a_fix_comes_it_stands_where_it_started_and_says_that_it_has_none() -> None:
    streams = make()
    assert latest(streams, "GPS_RAW_INT").fix_type == 1
    assert mavlink.kinematics(mavlink.decode(streams.beacon_frames(0))[1]).position == pytest.approx(START, abs=0.01)
    streams.fix(Gps(1 * S, START, STILL))
    for now_ns, fix_type in ((1 * S, 3), (4 * S - 1, 3), (4 * S, 1)):
        (raw,) = mavlink.decode(streams.one(24, now_ns) or b"")
        assert raw.fix_type == fix_type


def test_a_receiver_is_healthy_until_three_seconds_after_a_fix() -> None:
    streams = make()
    streams.fix(Gps(1 * S, START, STILL))
    for now_ns, healthy in ((1 * S, True), (4 * S - 1, True), (4 * S, False)):
        (status,) = mavlink.decode(streams.one(1, now_ns) or b"")
        assert bool(status.onboard_control_sensors_health & 32) == healthy  # MAV_SYS_STATUS_SENSOR_GPS


def test_a_heading_is_unknown_until_it_flies_and_a_beacon_is_as_long_as_later() -> None:
    streams = make()
    at_rest = streams.beacon_frames(1 * S)
    assert mavlink.kinematics(mavlink.decode(at_rest)[1]).yaw is None
    fly(streams, Enu(0.0, -5.0, 0.0))
    southbound = streams.beacon_frames(1 * S)
    assert mavlink.kinematics(mavlink.decode(southbound)[1]).yaw == pytest.approx(math.pi)
    assert len(at_rest) == len(southbound) == 61


def test_home_stays_where_it_started() -> None:
    streams = make()
    streams.fix(Gps(1 * S, Enu(900.0, 0.0, 80.0), STILL))
    home = latest(streams, "HOME_POSITION")
    assert (home.x, home.y, home.z) == (200.0, 100.0, -50.0)


def test_a_fix_that_comes_again_or_late_changes_nothing() -> None:
    streams = make()
    streams.fix(Gps(2 * S, START, Enu(1.0, 0.0, 0.0)))
    before = (streams.position, streams.velocity, streams.attitude)
    streams.fix(Gps(2 * S, STILL, Enu(9.0, 9.0, 9.0)))
    streams.fix(Gps(1 * S, STILL, Enu(9.0, 9.0, 9.0)))
    assert (streams.position, streams.velocity, streams.attitude) == before


# --- attitude -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed_m_s", [3.0, 7.5, 12.0])
def test_steady_flight_leans_against_drag_as_rotors_do_and_faces_where_it_goes(speed_m_s: float) -> None:
    streams, rotors = make(), Rotors(IRIS)
    fly(streams, Enu(speed_m_s, 0.0, 0.0), Enu(speed_m_s, 0.0, 0.0))
    velocity = np.array([[speed_m_s, 0.0, 0.0]])
    rotors.reset(np.array([[0.0, 0.0, 50.0]]), velocity)
    rotors.advance(8.0, velocity)
    assert streams.attitude == pytest.approx((0.0, -float(rotors.tilts_rad()[0]), math.pi / 2), abs=math.radians(0.7))


def test_who_hovers_in_wind_leans_into_it_and_has_an_airspeed() -> None:
    streams = make()
    fly(streams, Enu(0.0, 2.0, 0.0), Enu(0.0, 0.0, 0.0), Enu(0.0, 0.0, 0.0))
    streams.on_wind(WindEstimate(0, Enu(8.0, 0.0, 0.0)))
    assert streams.attitude.roll == pytest.approx(-math.atan((0.14 + 0.0105 * 8) * 8 / GRAVITY_M_S2))
    (hud,) = mavlink.decode(streams.one(common.MAVLINK_MSG_ID_VFR_HUD, 0) or b"")
    assert (hud.airspeed, hud.groundspeed) == (8.0, 0.0)


@pytest.mark.parametrize("course", [0.0, 1.0, 2.5, -2.0])
def test_speeding_up_puts_the_nose_down_whatever_the_course(course: float) -> None:
    streams = make()
    east, north = math.sin(course), math.cos(course)
    fly(streams, Enu(5.0 * east, 5.0 * north, 0.0), Enu(5.4 * east, 5.4 * north, 0.0))  # 2 m/s^2
    needed = 2.0 + (DRAG_PER_S + DRAG_PER_M * 5.4) * 5.4
    assert streams.attitude == pytest.approx((0.0, -math.atan(needed / GRAVITY_M_S2), course))


def test_a_right_turn_banks_right() -> None:
    streams = make()
    fly(streams, Enu(0.0, 5.0, 0.0), Enu(0.4, 5.0, 0.0))
    assert streams.attitude.roll > 0.1
    assert streams.attitude.yaw > 0


def test_hovering_keeps_the_heading() -> None:
    streams = make()
    fly(streams, Enu(5.0, 0.0, 0.0), Enu(0.1, -0.1, 0.0), Enu(0.0, 0.0, 0.0))
    assert streams.attitude.yaw == pytest.approx(math.pi / 2)


def thrust(attitude: Attitude) -> Enu:
    """The direction opposite to the body's down axis, by the aerospace rotation yaw, pitch, roll."""
    roll, pitch, yaw = attitude
    forward = -math.sin(pitch) * math.cos(roll)
    right = math.sin(roll)
    up = math.cos(pitch) * math.cos(roll)
    east = forward * math.sin(yaw) + right * math.cos(yaw)
    north = forward * math.cos(yaw) - right * math.sin(yaw)
    return Enu(east, north, up)


gentle = st.floats(-0.4, 0.4)


@given(st.floats(-10, 10), st.floats(-10, 10), st.builds(Enu, gentle, gentle, gentle))
def test_thrust_points_where_acceleration_drag_and_gravity_want_it(east: float, north: float, change: Enu) -> None:
    streams = make()
    now = Enu(east + change.east, north + change.north, change.up)
    fly(streams, Enu(east, north, 0.0), now)
    drag = DRAG_PER_S + DRAG_PER_M * now.norm()
    wanted = Enu(5 * change.east + drag * now.east, 5 * change.north + drag * now.north, 5 * change.up + GRAVITY_M_S2)
    assert thrust(streams.attitude) == pytest.approx(tuple(part / wanted.norm() for part in wanted), abs=1e-9)


@given(st.builds(Enu, *(st.floats(-50, 50),) * 3), st.builds(Enu, *(st.floats(-50, 50),) * 3))
def test_it_never_leans_more_than_a_multirotor_does(before: Enu, after: Enu) -> None:
    streams = make()
    fly(streams, before, after)
    assert thrust(streams.attitude).up >= math.cos(MAX_TILT) - 1e-9


# --- battery ------------------------------------------------------------------------------------------------------


def told_of_the_battery(streams: TelemetryStreams, now_ns: int) -> dict[str, Any]:
    found = {m.get_type(): m.to_dict() for m in mavlink.decode(streams.telemetry(now_ns))}
    return {**found["SYS_STATUS"], **found["BATTERY_STATUS"]}


def test_nothing_is_told_of_a_battery_that_nothing_measures() -> None:
    told = told_of_the_battery(make(telemetry_hz=1.0), S)
    assert (told["voltage_battery"], told["current_battery"], told["battery_remaining"]) == (65535, -1, -1)
    assert (told["voltages"], told["current_consumed"]) == ([65535] * 10, -1)


def test_a_battery_is_told_as_its_sensor_reads_it_and_what_was_drawn_from_it_adds_up() -> None:
    streams = make(telemetry_hz=1.0)
    for second, charge in ((0, 0.8), (1800, 0.504), (3600, 0.2)):
        streams.on_battery(Battery(second * S, voltage_v=14.8, current_a=3.0, charge=charge))
    told = told_of_the_battery(streams, 3600 * S)
    assert (told["voltage_battery"], told["voltages"][0], told["voltages"][1]) == (14800, 14800, 65535)
    assert (told["current_battery"], told["battery_remaining"], told["current_consumed"]) == (300, 20, 3000)


@pytest.mark.parametrize(("charge", "percent"), [(1.2, 100), (0.001, 1), (0.0, 0), (-0.1, 0)])
def test_a_battery_is_empty_only_when_nothing_is_left(charge: float, percent: int) -> None:
    streams = make(telemetry_hz=1.0)
    streams.on_battery(Battery(0, voltage_v=70.0, current_a=400.0, charge=charge))
    told = told_of_the_battery(streams, S)
    assert (told["battery_remaining"], told["voltage_battery"], told["current_battery"]) == (percent, 65534, 32767)


# --- an operator ------------------------------------------------------------------------------------------------------


def times_of(streams: TelemetryStreams, name: str, *, until_ns: int) -> list[int]:
    return [t_ns for t_ns, message in run(streams, until_ns=until_ns) if message.get_type() == name]


def test_an_operator_gets_what_comes_seldom_within_its_own_interval_and_what_is_due_sooner_no_later() -> None:
    slow = make(telemetry_hz=0.1)
    first_ns = times_of(slow, "ATTITUDE", until_ns=20 * S)[-1]
    slow.operator(first_ns + S // 4)
    after = times_of(slow, "ATTITUDE", until_ns=first_ns + 4 * S)
    assert after == [first_ns + S // 4 + k * S for k in (1, 2, 3)]
    soon = make(telemetry_hz=0.1)
    due_ns = times_of(soon, "ATTITUDE", until_ns=5 * S)[0] + 10 * S
    soon.operator(due_ns - S // 10)
    assert times_of(soon, "ATTITUDE", until_ns=due_ns + S)[0] == due_ns, "it was due before"
    fast = make(telemetry_hz=5.0)
    before = times_of(make(telemetry_hz=5.0), "GLOBAL_POSITION_INT", until_ns=3 * S)
    fast.operator(0)
    assert times_of(fast, "GLOBAL_POSITION_INT", until_ns=3 * S) == before, "nothing comes less often"


def test_an_interval_is_set_bounded_and_given_back() -> None:
    streams = make(telemetry_hz=1.0)
    attitude = common.MAVLINK_MSG_ID_ATTITUDE
    usual_ns = streams.interval_ns(attitude)
    assert usual_ns == S
    for wanted_ns, given_ns in ((S // 4, S // 4), (-1, 0), (None, S), (1, 20 * MS)):
        assert streams.set_interval(attitude, wanted_ns, S)
        assert streams.interval_ns(attitude) == given_ns
        due_ns = streams.next_due_ns()
        assert due_ns is not None
        assert due_ns < S + max(given_ns, S)
    assert streams.set_interval(attitude, None, S)
    assert streams.interval_ns(attitude) == S, "as usual"
    assert not streams.set_interval(1_000_000, S, 0)
    assert streams.interval_ns(1_000_000) is None


def test_what_is_not_sent_as_usual_begins_when_asked_for_at_the_phase_of_the_node() -> None:
    phase_ns = NODE * 7_919_000
    for ask in (lambda one: one.operator(5 * S), lambda one: one.set_interval(common.MAVLINK_MSG_ID_VFR_HUD, S, 5 * S)):
        streams = make(telemetry_hz=0)
        ask(streams)
        assert times_of(streams, "VFR_HUD", until_ns=8 * S) == [5 * S + phase_ns + k * S for k in range(3)]
