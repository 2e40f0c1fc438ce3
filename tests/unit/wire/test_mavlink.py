"""The border to pymavlink: coordinates, native messages, and the log files of other people's tools."""

import importlib
import math
import struct
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import pymavlink
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.applications.telemetry_streams import TelemetryStreams
from fanet_mw import mavlink, tlog, wire
from fanet_mw.errors import LocalProtocolError, MalformedFrameError
from fanet_mw.mavlink import Attitude, BatteryState, Encoder, Geodetic, Ned
from fanet_mw.units import MS, Enu, NodeId, S
from fanet_mw.wire.schedule import Join

NODE = NodeId(7)
STILL = Enu(0.0, 0.0, 0.0)
BATTERY = BatteryState(voltage_v=11.6, current_a=11.5, consumed_mah=1200, remaining_percent=76)

local_m = st.floats(-10_000, 10_000)
positions = st.builds(Enu, local_m, local_m, st.floats(-100, 5_000))
origins = st.builds(Geodetic, st.floats(-80, 80), st.floats(-179, 179), st.floats(-100, 4_000))
speeds = st.floats(-300, 300)
velocities = st.builds(Enu, speeds, speeds, speeds)


def distance_m(a: Enu, b: Enu) -> float:
    return a.minus(b).norm()


# --- coordinates --------------------------------------------------------------------------------------------------


@given(positions, origins)
def test_a_position_survives_the_way_over_the_earth_to_a_micrometre(position: Enu, origin: Geodetic) -> None:
    assert distance_m(mavlink.to_enu(mavlink.to_geodetic(position, origin), origin), position) < 1e-6


@given(positions, velocities, origins, st.none() | st.floats(-math.pi, math.pi))
def test_a_position_within_10_km_survives_the_message_to_a_centimetre(
    position: Enu, velocity: Enu, origin: Geodetic, yaw: float | None
) -> None:
    frame = Encoder(NODE, origin=origin).global_position(position, velocity, yaw=yaw, now_ns=1234 * MS)
    (message,) = mavlink.decode(frame)
    heard = mavlink.kinematics(message, origin)
    assert distance_m(heard.position, position) < 0.01
    assert distance_m(heard.velocity, velocity) < 0.01
    assert heard.t_ms == 1234
    if yaw is None or heard.yaw is None:
        assert heard.yaw is yaw
    else:
        assert math.cos(heard.yaw - yaw) == pytest.approx(1, abs=1e-7)


@given(velocities)
def test_ned_is_north_east_down_and_back_again(velocity: Enu) -> None:
    assert mavlink.to_ned(velocity) == Ned(velocity.north, velocity.east, -velocity.up)
    assert mavlink.from_ned(mavlink.to_ned(velocity)) == velocity


def test_the_ends_of_the_ellipsoid_are_where_its_axes_say() -> None:
    """From the equator, the pole is one semi-minor axis up north and one semi-major axis down."""
    pole = mavlink.to_enu(Geodetic(90.0, 0.0, 0.0), Geodetic(0.0, 0.0, 0.0))
    assert pole == pytest.approx((0.0, 6_356_752.314_245, -6_378_137.0), abs=1e-3)


@pytest.mark.parametrize("lat_deg", [-60.0, 0.0, 37.5, 45.0, 75.0])
def test_a_degree_is_as_long_as_the_usual_series_for_wgs84_says(lat_deg: float) -> None:
    phi = math.radians(lat_deg)
    of_latitude = 111_132.92 - 559.82 * math.cos(2 * phi) + 1.175 * math.cos(4 * phi)
    of_longitude = 111_412.84 * math.cos(phi) - 93.5 * math.cos(3 * phi) + 0.118 * math.cos(5 * phi)
    origin = Geodetic(lat_deg, 9.0, 0.0)
    north = mavlink.to_enu(Geodetic(lat_deg + 0.001, 9.0, 0.0), origin).north
    east = mavlink.to_enu(Geodetic(lat_deg, 9.001, 0.0), origin).east
    assert (north * 1000, east * 1000) == pytest.approx((of_latitude, of_longitude), abs=1.0)


def test_the_earth_falls_away_from_the_tangent_plane() -> None:
    """A point 10 km away in the plane is d^2/2R = 7.8 m over the ground: the plane is no map."""
    far = mavlink.to_geodetic(Enu(10_000.0, 0.0, 0.0), Geodetic(0.0, 0.0, 0.0))
    assert far.alt_m == pytest.approx(10_000**2 / (2 * 6_378_137), abs=0.01)
    assert far.lat_deg == pytest.approx(0.0, abs=1e-12)


def test_an_origin_off_the_earth_is_our_own_mistake() -> None:
    with pytest.raises(LocalProtocolError, match=r"lat_deg=91"):
        mavlink.to_geodetic(STILL, Geodetic(91.0, 0.0, 0.0))


# --- messages -----------------------------------------------------------------------------------------------------


def one(frame: bytes) -> dict[str, Any]:
    (message,) = mavlink.decode(frame)
    return dict(message.to_dict())


def test_a_heartbeat_is_that_of_a_flying_quadrotor() -> None:
    (message,) = mavlink.decode(Encoder(NODE, component=1).heartbeat())
    assert (message.get_srcSystem(), message.get_srcComponent()) == (7, 1)
    assert (message.type, message.system_status, message.base_mode & 128) == (2, 4, 128)


def test_velocities_beyond_the_field_stay_at_its_end_instead_of_wrapping() -> None:
    fast = one(Encoder(NODE).global_position(STILL, Enu(400.0, -400.0, 400.0), yaw=None, now_ns=0))
    assert (fast["vx"], fast["vy"], fast["vz"]) == (-32768, 32767, -32768)


def test_the_relative_altitude_is_over_the_origins() -> None:
    high = Encoder(NODE, origin=Geodetic(45.0, 9.0, 1500.0))
    message = one(high.global_position(Enu(0.0, 0.0, 80.0), STILL, yaw=None, now_ns=0))
    assert (message["alt"], message["relative_alt"]) == (1_580_000, 80_000)


@pytest.mark.parametrize(("yaw", "centidegrees"), [(0.0, 0), (math.pi / 2, 9000), (-math.pi / 2, 27000), (-1e-9, 0)])
def test_headings_are_clockwise_from_north_in_0_to_36000(yaw: float, centidegrees: int) -> None:
    assert one(Encoder(NODE).global_position(STILL, STILL, yaw=yaw, now_ns=0))["hdg"] == centidegrees


def test_milliseconds_since_boot_wrap_after_49_days() -> None:
    late_ns = (2**32 + 5) * MS
    assert one(Encoder(NODE).attitude(Attitude(0.0, 0.0, 0.0), now_ns=late_ns))["time_boot_ms"] == 5


def test_gps_raw_says_whether_there_is_a_fix_and_where_it_goes() -> None:
    moving = Enu(3.0, 0.0, 1.0)
    message = one(Encoder(NODE).gps_raw(STILL, moving, has_fix=True, fix_ns=2 * S))
    assert (message["fix_type"], message["vel"], message["cog"], message["time_usec"]) == (3, 300, 9000, 2_000_000)
    assert one(Encoder(NODE).gps_raw(STILL, STILL, has_fix=False, fix_ns=0))["fix_type"] == 1


def test_the_battery_is_the_same_in_both_messages_that_have_it() -> None:
    status, battery = one(Encoder(NODE).sys_status(BATTERY)), one(Encoder(NODE).battery_status(BATTERY))
    assert battery["voltages"] == [11600] + [65535] * 9
    assert status["voltage_battery"] == battery["voltages"][0]
    assert status["current_battery"] == battery["current_battery"] == 1150
    assert status["battery_remaining"] == battery["battery_remaining"] == 76
    assert battery["current_consumed"] == 1200


def test_home_is_given_on_earth_and_in_ned() -> None:
    home = one(Encoder(NODE).home_position(Enu(10.0, 20.0, 30.0)))
    assert (home["x"], home["y"], home["z"]) == (20.0, 10.0, -30.0)
    assert home["altitude"] == pytest.approx(30_000, abs=1)


def test_messages_that_never_change_are_numbered_with_the_others_and_stay_whole() -> None:
    encoder, made = Encoder(NODE), []
    for _ in range(100):
        made += [encoder.heartbeat(), encoder.extended_sys_state(), encoder.sys_status(None)]
    assert [mavlink.decode(frame)[0].get_seq() for frame in made] == [number % 256 for number in range(300)]


def test_a_vehicle_in_the_air_says_so() -> None:
    assert one(Encoder(NODE).extended_sys_state())["landed_state"] == 2


def test_each_encoder_counts_its_own_frames_and_wraps() -> None:
    one_node, other = Encoder(NODE), Encoder(NODE)
    sequences = [mavlink.decode(one_node.heartbeat())[0].get_seq() for _ in range(258)]
    assert sequences == [*range(256), 0, 1]
    assert mavlink.decode(other.heartbeat())[0].get_seq() == 0


# --- decoding -----------------------------------------------------------------------------------------------------


def test_one_parser_reads_native_and_our_own_messages_in_one_frame() -> None:
    header = wire.Header(12, 1, 3, 0xFFFF, 3, wire.Kind.HELLO, 1, 0, 0, 0)
    frame = header.encode() + Encoder(NODE).heartbeat() + Join(3, STILL).encode_frame(3) + wire.filler(300)
    names = [message.get_type() for message in mavlink.decode(frame)]
    assert names == ["FANET_ROUTE", "HEARTBEAT", "FANET_JOIN", "FANET_CHUNK", "FANET_CHUNK"]


NATIVE = Encoder(NODE).heartbeat() + Encoder(NODE).gps_raw(STILL, STILL, has_fix=True, fix_ns=5)


@given(st.binary(max_size=60) | st.builds(lambda n, tail: NATIVE[:n] + tail, st.integers(0, 80), st.binary(max_size=9)))
def test_garbage_is_one_error(data: bytes) -> None:
    with suppress(MalformedFrameError):
        mavlink.decode(data)


@given(st.data())
def test_one_changed_bit_in_a_native_frame_is_noticed_unless_it_names_another_message(data: st.DataObject) -> None:
    frame = bytearray(Encoder(NODE).heartbeat())
    at = data.draw(st.integers(0, 8 * len(frame) - 1))
    frame[at // 8] ^= 1 << at % 8
    try:
        (message,) = mavlink.decode(bytes(frame))
    except MalformedFrameError:
        return
    assert 7 <= at // 8 < 10  # the message id: nobody knows the CRC of a message without a definition
    assert message.get_type().startswith("UNKNOWN")


def test_importing_the_border_does_not_import_mavutil() -> None:
    code = "import sys, fanet_mw.mavlink; sys.exit('pymavlink.mavutil' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# --- the log ------------------------------------------------------------------------------------------------------


def test_a_log_gives_back_every_frame_with_its_instant(tmp_path: Path) -> None:
    encoder = Encoder(NODE, component=mavlink.AUTOPILOT_COMPONENT)
    first, second, third = encoder.heartbeat(), wire.filler(256), encoder.heartbeat()
    tlog.write(tmp_path / "a.tlog", [(1500, first + second), (3 * S, third)], epoch_us=10)
    assert list(tlog.read(tmp_path / "a.tlog")) == [(11, first), (11, second), (3_000_010, third)]


@given(st.binary(max_size=64), st.integers(0, 255), st.integers(0, 255), st.integers(0, 255), st.integers(0, 255))
def test_a_frame_with_another_number_is_the_frame_that_would_have_been_made_with_it(
    payload: bytes, seq: int, other: int, extra: int, flip: int
) -> None:
    """Of any message, known or not; a CRC that was wrong stays as wrong."""
    spec = wire.Spec(53000 + extra, extra, struct.Struct(""))
    before, after = (wire.encode_inner(spec, payload, node=7, seq=number) for number in (seq, other))
    assert wire.renumbered(before, other) == after
    broken = before[:-1] + bytes((before[-1] ^ flip,))
    assert wire.renumbered(broken, other) == after[:-1] + bytes((after[-1] ^ flip,))


def test_a_signed_frame_keeps_its_number() -> None:
    plain = wire.filler(60)
    signed = plain[:2] + b"\1" + plain[3:] + bytes(13)
    assert wire.renumbered(signed, 9) == signed


def test_the_numbers_of_each_component_run_without_a_gap(tmp_path: Path) -> None:
    """Frames of many nodes in one log, the same report from each that received it: a reader takes a gap for a loss."""
    swarm = [TelemetryStreams(NodeId(node), position=Enu(0.0, 0.0, 50.0), telemetry_hz=4) for node in (1, 2)]
    taps = []
    for t_ns in range(0, 40 * S, 100 * MS):
        for streams in swarm:
            streams.beacon_frames(t_ns)  # sent over the air, never logged
            taps.append((t_ns, streams.telemetry(t_ns) + wire.filler(64, node=2)))
    path = tmp_path / "a.tlog"
    tlog.write(path, taps)
    seen: dict[tuple[int, int], list[int]] = {}
    for _, frame in tlog.read(path):
        seen.setdefault((frame[5], frame[6]), []).append(frame[4])
        assert mavlink.decode(frame)
    assert sorted(seen) == [(1, 1), (2, 1), (2, 191)]
    for numbers in seen.values():
        assert len(numbers) > 256
        assert numbers == [number % 256 for number in range(len(numbers))]
    tool = Path(pymavlink.__file__).parent / "tools" / "mavloss.py"
    said = subprocess.run([sys.executable, str(tool), str(path)], capture_output=True, text=True, check=True).stdout
    assert said.splitlines()[-1] == "Total: 672 packets, 0 lost 0.0%"


def test_telemetry_on_its_topic_has_no_gaps_where_hellos_were_sent() -> None:
    streams = TelemetryStreams(NodeId(1), position=Enu(0.0, 0.0, 50.0), telemetry_hz=4)
    numbers = []
    for t_ns in range(0, 5 * S, 100 * MS):
        streams.beacon_frames(t_ns)
        numbers += [frame[4] for frame in wire.frames(streams.telemetry(t_ns))]
    assert numbers == list(range(len(numbers)))


def test_a_log_can_be_appended_to(tmp_path: Path) -> None:
    path = tmp_path / "a.tlog"
    for t_us in (1, 2):
        with path.open("ab") as file:
            assert tlog.append(file, Encoder(NODE).heartbeat(), t_us=t_us) == 1
    assert [t_us for t_us, _ in tlog.read(path)] == [1, 2]


def test_a_broken_run_of_frames_leaves_the_log_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "a.tlog"
    with path.open("wb") as file, pytest.raises(MalformedFrameError):
        tlog.append(file, Encoder(NODE).heartbeat() + b"\xfd", t_us=1)
    assert path.read_bytes() == b""


RECORD = (2**64 - 1).to_bytes(8, "big") + Encoder(NODE).heartbeat()


@pytest.mark.parametrize("length", [0, 1, 8, 9, 28, 29, 30, 57, 58, 66, 86, 87])
def test_a_log_cut_off_anywhere_gives_what_is_whole_and_then_one_error(tmp_path: Path, length: int) -> None:
    path = tmp_path / "a.tlog"
    path.write_bytes((RECORD * 3)[:length])
    whole, left = divmod(length, len(RECORD))
    pairs = tlog.read(path)
    assert [next(pairs) for _ in range(whole)] == [(2**64 - 1, RECORD[8:])] * whole
    if left:
        with pytest.raises(MalformedFrameError, match=f"byte {whole * len(RECORD)}"):
            next(pairs)
    else:
        assert next(pairs, None) is None


def test_pymavlinks_own_reader_reads_the_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAVLINK20", "1")
    mavutil = importlib.import_module("pymavlink.mavutil")
    encoder = Encoder(NODE, component=mavlink.AUTOPILOT_COMPONENT)
    position = encoder.global_position(Enu(10.0, 20.0, 30.0), STILL, yaw=0.0, now_ns=2 * S)
    tlog.write(tmp_path / "a.tlog", [(1 * S, encoder.heartbeat()), (2 * S, position)])
    log = mavutil.mavlink_connection(str(tmp_path / "a.tlog"), dialect="common")
    try:
        heard = [log.recv_match(), log.recv_match()]
        assert [(m.get_type(), m._timestamp) for m in heard] == [("HEARTBEAT", 1.0), ("GLOBAL_POSITION_INT", 2.0)]
        assert log.recv_match() is None
        assert log.sysid == 7  # it took us for a vehicle
    finally:
        log.close()


# --- in radio frames ----------------------------------------------------------------------------------------------


def in_a_frame(inner: bytes) -> bytes:
    header = wire.Header(0, 1, 7, 0xFFFF, 7, wire.Kind.DATA, 9, 0, wire.PRIORITY_SAFETY, 0)
    return header.encode() + inner


@given(st.integers(1, 65_534), st.floats(0, 3600), st.floats(0, 1000), st.floats(0, 1000))
def test_a_collision_is_read_back_as_it_was_said(other, closest_s, altitude_m, horizontal_m) -> None:
    inner = Encoder(NODE).collision(
        NodeId(other), closest_s=closest_s, altitude_m=altitude_m, horizontal_m=horizontal_m
    )
    found = mavlink.collision_of(in_a_frame(wire.filler(40) + inner))
    assert found.other == other
    assert found[1:] == pytest.approx((closest_s, altitude_m, horizontal_m), rel=1e-6, abs=1e-30)


@pytest.mark.parametrize(
    ("other", "values"),
    [(0, (1.0, 1.0, 1.0)), (70_000, (1.0, 1.0, 1.0)), (3, (math.nan, 1.0, 1.0)), (3, (1.0, -1.0, 1.0))],
)
def test_a_collision_with_no_node_or_at_no_distance_is_malformed(other, values) -> None:
    closest_s, altitude_m, horizontal_m = values
    inner = Encoder(NODE).collision(other, closest_s=closest_s, altitude_m=altitude_m, horizontal_m=horizontal_m)
    with pytest.raises(MalformedFrameError, match="collision from source 1"):
        mavlink.collision_of(in_a_frame(inner))


@given(st.binary(max_size=80))
def test_whatever_follows_a_header_is_a_position_or_malformed(rest: bytes) -> None:
    for read in (mavlink.kinematics_of, mavlink.collision_of):
        with suppress(MalformedFrameError):
            read(in_a_frame(rest))
