"""A UAV's computer beside a flight controller of PX4 or ArduPilot, as timelines by hand."""

import asyncio
import math
import os
import pty
import random
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega

from fanet_mw.autopilot.link import AutopilotLink
from fanet_mw.autopilot.serving import Autopilot, AutopilotBus
from fanet_mw.bus import codecs
from fanet_mw.bus.messages import Battery, FlightState, Gps, Setpoint, SetpointKind
from fanet_mw.bus.topics import Topics
from fanet_mw.flavors import Flavor, Mode, number_of
from fanet_mw.gateway.connections import Address
from fanet_mw.hosts.timebase import THIS_MACHINE
from fanet_mw.mavlink import Geodetic, common, decode, to_geodetic
from fanet_mw.rng import stream
from fanet_mw.units import MS, STILL, Enu, NodeId, S
from fanet_mw.wire import COMPONENT

ORIGIN = Geodetic(37.5665, 126.978, 0.0)
AMSL_M = 40.0


class Controller:
    """A flight controller that answers, and the link to it."""

    def __init__(self, flavor: Flavor = Flavor.PX4) -> None:
        self.link = AutopilotLink(flavor=flavor, origin=ORIGIN)
        self.mav = common.MAVLink(None, srcSystem=7, srcComponent=1)
        self.flavor = flavor
        self.mode, self.armed, self.at = Mode.HOLD, False, Enu(10.0, 20.0, 0.0)
        self.now_ns = 0
        self.said: list[Any] = []
        self.answers = True
        self.silent = False
        self.knows_place = True
        self.result = 0

    def tell(self, message: Any) -> None:
        self.link.on_bytes(bytes(message.pack(self.mav)), self.now_ns)

    def run(self, seconds: float) -> list[Any]:
        """Let time pass; returns what the computer has said meanwhile."""
        before, until_ns = len(self.said), self.now_ns + round(seconds * S)
        while self.now_ns < until_ns:
            self.now_ns += 50 * MS
            if not self.silent and self.now_ns % S == 0:
                self.beat()
            if not self.silent and self.knows_place and self.now_ns % (200 * MS) == 0:
                self.position()
            self.link.wake(self.now_ns)
            out, self.link.out = self.link.out, b""
            for message in decode(out):
                self.said.append(message)
                if message.get_type() == "COMMAND_LONG" and self.answers:
                    self.obey(message)
        return self.said[before:]

    def beat(self) -> None:
        kind = common.MAV_AUTOPILOT_PX4 if self.flavor is Flavor.PX4 else common.MAV_AUTOPILOT_ARDUPILOTMEGA
        self.tell(
            common.MAVLink_heartbeat_message(2, kind, 1 | 128 * self.armed, number_of(self.mode, self.flavor), 4, 3)
        )

    def position(self) -> None:
        place = to_geodetic(self.at._replace(up=0.0), ORIGIN)
        lat, lon = round(place.lat_deg * 1e7), round(place.lon_deg * 1e7)
        alt_mm, up_mm = round(1000 * (AMSL_M + self.at.up)), round(1000 * self.at.up)
        self.tell(common.MAVLink_global_position_int_message(0, lat, lon, alt_mm, up_mm, 100, 200, -300, 0))

    def obey(self, message: Any) -> None:
        if message.command == 400 and self.result == 0:
            self.armed = bool(message.param1)
        if message.command == 176 and self.result == 0:
            number = int(message.param2) << 16 | int(message.param3) << 24
            number = number if self.flavor is Flavor.PX4 else int(message.param2)
            self.mode = next(m for m in (Mode.GUIDED, *Mode) if number_of(m, self.flavor) == number)
        self.tell(common.MAVLink_command_ack_message(message.command, self.result))

    def want(self, kind: SetpointKind, place: Enu = STILL, speed: float = 6.0, velocity: Enu = STILL) -> None:
        self.link.command(Setpoint(self.now_ns, place, speed, kind, velocity), self.now_ns)


def commands(said: list[Any]) -> list[int]:
    return [message.command for message in said if message.get_type() == "COMMAND_LONG"]


def places(said: list[Any]) -> list[Any]:
    return [message for message in said if message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT"]


def test_streams_are_asked_for_one_by_one_and_each_answer_is_checked() -> None:
    controller = Controller()
    controller.result = 3
    said = controller.run(9)
    asked = [(message.param1, message.param2) for message in said if message.get_type() == "COMMAND_LONG"]
    assert asked == [(33, 200_000), (24, 1_000_000), (1, 1_000_000), (245, 1_000_000), (30, 200_000), (2, 1_000_000)]
    assert controller.link.counts["refused"] == 6
    assert any("refused (3): message 33" in event for event in controller.link.events)


def test_what_is_not_answered_is_said_again_and_given_up() -> None:
    controller = Controller()
    controller.answers = False
    said = controller.run(20)
    assert commands(said) == [511] * 18
    assert [message.confirmation for message in said if message.get_type() == "COMMAND_LONG"] == [0, 1, 2] * 6
    assert controller.link.counts["unanswered"] == 6


def test_position_velocity_and_battery_come_in_the_swarms_frame() -> None:
    controller = Controller()
    controller.at = Enu(120.0, -40.0, 25.0)
    controller.run(3)
    fix = [reading for reading in controller.link.readings if isinstance(reading, Gps)][-1]
    assert fix.position == pytest.approx((120, -40, 25), abs=0.02)
    assert fix.velocity == pytest.approx((2, 1, 3))
    controller.tell(common.MAVLink_sys_status_message(0, 0, 0, 0, 15_200, 820, 63, 0, 0, 0, 0, 0, 0))
    assert controller.link.readings[-1] == Battery(controller.now_ns, 15.2, 8.2, 0.63)


def test_attitude_time_and_the_quality_of_gps_come_from_the_flight_controller() -> None:
    controller = Controller()
    controller.run(2)
    unix_us = 1_800_000_000_000_000
    controller.tell(common.MAVLink_attitude_message(0, 0.1, -0.2, 3.0, 0, 0, 0))
    assert controller.link.readings[-1] == pytest.approx((controller.now_ns, 0.1, -0.2, 3.0, 255, None, 0))
    controller.tell(common.MAVLink_gps_raw_int_message(0, 3, 0, 0, 0, 80, 65_535, 0, 0, 14))
    controller.tell(common.MAVLink_system_time_message(unix_us, 7))
    controller.now_ns += S
    controller.tell(common.MAVLink_attitude_message(0, 0.1, -0.2, 3.0, 0, 0, 0))
    state = controller.link.readings[-1]
    assert isinstance(state, FlightState)
    assert (state.satellites, state.hdop, state.unix_ns) == (14, 0.8, 1000 * unix_us + S)


@pytest.mark.parametrize("unix_us", [0, 86_400_000_000, 1 << 60, (1 << 64) - 1])
def test_a_clock_that_was_never_set_is_no_time_of_gps(unix_us: int) -> None:
    controller = Controller()
    controller.run(2)
    controller.tell(common.MAVLink_system_time_message(unix_us, 7))
    assert controller.link.unix_off_ns is None


def test_an_attitude_that_is_no_number_is_counted() -> None:
    controller = Controller()
    controller.run(2)
    controller.link.readings.clear()
    controller.tell(common.MAVLink_attitude_message(0, math.nan, 0, 0, 0, 0, 0))
    assert not controller.link.readings
    assert controller.link.counts["no_attitude"] == 1


@pytest.mark.parametrize(("off_s", "tells"), [(0.5, 0), (3600.0, 1)])
def test_a_computer_whose_clock_is_wrong_is_told_so_once(off_s: float, tells: int) -> None:
    controller = Controller()
    controller.run(2)
    said: list[str] = []
    autopilot = Autopilot(
        "UAV 1", controller.link, Address("udpin", "127.0.0.1", 0), now_ns=lambda: controller.now_ns, tell=said.append
    )
    controller.tell(common.MAVLink_system_time_message(round((THIS_MACHINE.unix_ns() / S + off_s) * 1e6), 7))
    autopilot.tick()
    autopilot.tick()
    assert sum("this computer's clock differs by +36" in line or "by +3599" in line for line in said) == tells


def test_without_a_fix_there_is_no_position() -> None:
    controller = Controller()
    controller.run(2)
    controller.tell(common.MAVLink_gps_raw_int_message(0, 1, 0, 0, 0, 0, 0, 0, 0, 0))
    controller.link.readings.clear()
    controller.run(2)
    assert not controller.link.readings
    assert controller.link.counts["no_fix"] == 10


@pytest.mark.parametrize(("flavor", "height_m"), [(Flavor.PX4, AMSL_M + 20.0), (Flavor.ARDUPILOT, 20.0)])
def test_a_take_off_arms_first_and_counts_its_height_as_the_flavor_does(flavor: Flavor, height_m: float) -> None:
    controller = Controller(flavor)
    controller.run(6)
    controller.want(SetpointKind.TAKEOFF, Enu(10.0, 20.0, 20.0))
    said = controller.run(3)
    wanted = [176, 400, 22] if flavor is Flavor.ARDUPILOT else [400, 22]
    assert commands(said) == wanted
    take_off = [message for message in said if message.get_type() == "COMMAND_LONG"][-1]
    assert take_off.param7 == height_m
    assert math.isnan(take_off.param5)
    assert controller.armed


@pytest.mark.parametrize("flavor", [*Flavor])
def test_a_take_off_that_is_wanted_before_the_first_position_is_asked_for_after_it(flavor: Flavor) -> None:
    """PX4 was asked for 20 m above the sea, home being at 40 m, and never again."""
    controller = Controller(flavor)
    controller.knows_place = False
    controller.want(SetpointKind.TAKEOFF, Enu(10.0, 20.0, 20.0))
    assert not {22, 400} & set(commands(controller.run(8)))
    controller.knows_place = True
    take_off = [m for m in controller.run(4) if m.get_type() == "COMMAND_LONG" and m.command == 22]
    assert [m.param7 for m in take_off] == [20.0 + AMSL_M * (flavor is Flavor.PX4)]
    assert controller.armed


@pytest.mark.parametrize("flavor", [*Flavor])
def test_a_place_is_streamed_before_the_guided_mode_is_asked_for(flavor: Flavor) -> None:
    controller = Controller(flavor)
    controller.run(6)
    controller.want(SetpointKind.POSITION, Enu(100.0, 50.0, 30.0))
    said = controller.run(3)
    kinds = [m.command if m.get_type() == "COMMAND_LONG" else m.get_type()[:12] for m in said]
    assert kinds.index(176) > kinds.index("SET_POSITION") + 1
    assert controller.mode is Mode.GUIDED
    assert commands(said).count(178) == 1
    place = to_geodetic(Enu(100.0, 50.0, 0.0), ORIGIN)
    last = places(said)[-1]
    assert (last.lat_int / 1e7, last.lon_int / 1e7, last.alt) == pytest.approx(
        (place.lat_deg, place.lon_deg, 30.0), abs=1e-6
    )
    assert last.coordinate_frame == common.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    assert len(places(controller.run(2))) == 8


def test_a_velocity_that_is_not_renewed_becomes_a_hold() -> None:
    controller = Controller()
    controller.run(6)
    controller.want(SetpointKind.VELOCITY, velocity=Enu(3.0, 4.0, 1.0))
    said = controller.run(0.9)
    flown = [message for message in said if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
    assert [(m.vx, m.vy, m.vz) for m in flown] == [(4.0, 3.0, -1.0)] * len(flown)
    assert len(flown) >= 3
    held = places(controller.run(2))
    assert len(held) >= 4
    assert held[-1].alt == pytest.approx(controller.at.up)
    assert "no more velocities: holding" in controller.link.events


@pytest.mark.parametrize(("kind", "mode"), [(SetpointKind.LAND, Mode.LAND), (SetpointKind.RETURN, Mode.RETURN)])
def test_landing_and_return_are_modes_and_no_setpoints_flow(kind: SetpointKind, mode: Mode) -> None:
    controller = Controller()
    controller.run(6)
    controller.want(SetpointKind.POSITION, Enu(0.0, 0.0, 30.0))
    controller.run(3)
    controller.want(kind)
    said = controller.run(4)
    assert controller.mode is mode
    assert not places(said)
    assert not controller.link.yielded, "it was asked to leave the guided mode"


def test_a_landing_does_not_wait_for_a_speed_that_nobody_acknowledges() -> None:
    controller = Controller()
    controller.run(6)
    controller.want(SetpointKind.POSITION, Enu(0.0, 0.0, 30.0))
    controller.run(3)
    controller.answers = False
    controller.want(SetpointKind.POSITION, Enu(0.0, 0.0, 30.0), speed=9.0)
    controller.want(SetpointKind.POSITION, Enu(9.0, 0.0, 30.0), speed=9.0)
    assert commands(controller.run(0.2)) == [178]
    controller.want(SetpointKind.LAND)
    assert commands(controller.run(0.2)) == [176]
    controller.answers = True
    assert commands(controller.run(3)) == [176, 178], "the speed is said again after it"
    assert controller.mode is Mode.LAND


def test_another_speed_on_the_way_to_the_same_place_is_asked_for() -> None:
    controller = Controller()
    controller.run(6)
    controller.want(SetpointKind.POSITION, Enu(0.0, 0.0, 30.0), speed=6.0)
    controller.run(3)
    controller.want(SetpointKind.POSITION, Enu(0.0, 0.0, 30.0), speed=3.0)
    (speed,) = [said for said in controller.run(3) if said.get_type() == "COMMAND_LONG"]
    assert (speed.command, speed.param2) == (178, 3.0)


@pytest.mark.parametrize("interrupted", ["by a pilot", "by a take-off", "by a restart"])
def test_a_speed_that_nobody_carried_out_or_that_was_forgotten_is_asked_for_again(interrupted: str) -> None:
    controller = Controller()
    controller.run(6)
    controller.want(SetpointKind.POSITION, Enu(0.0, 0.0, 30.0), speed=6.0)
    controller.run(4)
    controller.answers = interrupted == "by a restart"
    controller.want(SetpointKind.POSITION, Enu(9.0, 0.0, 30.0), speed=9.0)
    controller.run(0.2)
    controller.answers = True
    if interrupted == "by a pilot":
        controller.mode = Mode.RETURN
        controller.run(2)
        controller.mode = Mode.GUIDED
    elif interrupted == "by a take-off":
        controller.want(SetpointKind.TAKEOFF, Enu(9.0, 0.0, 30.0))
    else:
        controller.silent = True
        controller.run(4)
        controller.silent = False
    controller.run(10)
    controller.want(SetpointKind.POSITION, Enu(0.0, 9.0, 30.0), speed=9.0)
    assert 178 in commands(controller.run(2))


def test_what_is_answered_to_another_computer_is_no_answer_to_ours() -> None:
    """Ground stations on the same flight controller ask for streams, arm and set modes, too."""
    controller = Controller()
    controller.answers = False
    controller.run(1.2)
    controller.tell(common.MAVLink_command_ack_message(511, 0, 0, 0, 255, 190))
    controller.tell(common.MAVLink_command_ack_message(511, 0, 0, 0, 7, 190))
    assert not controller.link.counts["accepted"]
    controller.tell(common.MAVLink_command_ack_message(511, 0, 0, 0, 7, COMPONENT))
    assert controller.link.counts["accepted"] == 1


def test_whoever_takes_over_is_left_alone_until_the_guided_mode_is_back() -> None:
    controller = Controller()
    controller.run(6)
    controller.want(SetpointKind.POSITION, Enu(0.0, 0.0, 30.0))
    controller.run(4)
    controller.mode = Mode.RETURN  # its own failsafe
    controller.run(1)
    assert controller.link.yielded
    controller.want(SetpointKind.POSITION, Enu(50.0, 0.0, 30.0))
    controller.want(SetpointKind.TAKEOFF, Enu(50.0, 0.0, 30.0))
    said = controller.run(5)
    assert {message.get_type() for message in said} == {"HEARTBEAT"}
    controller.want(SetpointKind.POSITION, Enu(50.0, 0.0, 30.0))
    controller.mode = Mode.GUIDED
    assert places(controller.run(3))
    assert not controller.link.yielded


def test_a_flight_controller_that_falls_silent_is_lost_and_found_again() -> None:
    controller = Controller()
    controller.run(6)
    controller.want(SetpointKind.POSITION, Enu(0.0, 0.0, 30.0))
    controller.run(2)
    controller.silent = True
    controller.run(4)
    assert controller.link.lost
    assert not places(controller.run(2))
    controller.silent = False
    controller.run(2)
    assert not controller.link.lost
    assert [event for event in controller.link.events if "heard" in event] == [
        "flight controller 7 heard", "flight controller not heard for 3 s", "flight controller heard again",
    ]  # fmt: skip


@pytest.mark.parametrize(("kind", "mode"), [(SetpointKind.LAND, Mode.LAND), (SetpointKind.RETURN, Mode.RETURN)])
def test_what_was_asked_of_a_lost_flight_controller_it_is_told_once_it_is_heard_again(
    kind: SetpointKind, mode: Mode
) -> None:
    controller = Controller()
    controller.run(6)
    controller.want(SetpointKind.POSITION, Enu(0.0, 0.0, 30.0))
    controller.run(3)
    controller.silent = True
    controller.run(4)
    controller.want(kind)
    controller.run(1)
    controller.want(kind)  # the computer repeats it, so that it counts as alive
    controller.silent = False
    controller.run(3)
    assert controller.mode is mode


def test_a_pilot_may_break_off_the_landing_that_a_lost_flight_controller_was_told_of() -> None:
    controller = Controller()
    controller.run(9)
    controller.silent = True
    controller.run(4)
    controller.want(SetpointKind.LAND)
    controller.silent = False
    controller.run(9)
    controller.mode = Mode.HOLD
    assert not commands(controller.run(3)), "it was told once"
    assert controller.mode is Mode.HOLD


def test_what_was_asked_while_a_pilot_flew_is_flown_once_the_guided_mode_is_back() -> None:
    controller = Controller()
    controller.run(6)
    controller.want(SetpointKind.POSITION, Enu(0.0, 0.0, 30.0))
    controller.run(4)
    controller.mode = Mode.HOLD
    controller.run(1)
    controller.want(SetpointKind.RETURN)
    controller.run(2)
    assert controller.mode is Mode.HOLD
    controller.mode = Mode.GUIDED
    controller.run(3)
    assert controller.mode is Mode.RETURN


def test_a_flight_controller_that_has_started_again_is_asked_for_its_streams_again() -> None:
    controller = Controller()
    controller.run(9)
    controller.silent = True
    controller.run(5)
    controller.silent = False
    assert commands(controller.run(9)) == [511] * 6


@pytest.mark.parametrize("flavor", [*Flavor])
def test_a_take_off_that_is_broken_off_is_not_flown_after_the_landing(flavor: Flavor) -> None:
    controller = Controller(flavor)
    controller.run(6)
    controller.answers = False
    controller.want(SetpointKind.TAKEOFF, Enu(10.0, 20.0, 20.0))
    controller.run(0.5)
    controller.answers = True
    controller.want(SetpointKind.LAND)
    said = controller.run(6)
    assert controller.mode is Mode.LAND
    assert commands(said)[-1] == 176, "nothing follows the landing"
    assert 22 not in commands(said)


def test_a_take_off_leaves_the_streams_asked_for() -> None:
    controller = Controller()
    controller.run(1.1)
    controller.want(SetpointKind.TAKEOFF, Enu(10.0, 20.0, 20.0))
    assert commands(controller.run(0.2))[:2] == [400, 22]
    controller.run(9)
    assert {m.param1 for m in controller.said if m.get_type() == "COMMAND_LONG" and m.command == 511} == {
        33, 24, 1, 245, 30, 2,
    }  # fmt: skip


@pytest.mark.parametrize("size", [1, 7, 30])
def test_a_bridge_from_serial_to_udp_may_cut_frames_anywhere(size: int) -> None:
    controller = Controller()
    beat = common.MAVLink_heartbeat_message(2, common.MAV_AUTOPILOT_PX4, 1, number_of(Mode.HOLD), 4, 3)
    sent = b"".join(bytes(beat.pack(controller.mav)) for _ in range(20))
    for at in range(0, len(sent), size):
        controller.link.on_bytes(sent[at : at + size], controller.now_ns)
    assert controller.link.mode is Mode.HOLD
    assert not controller.link.counts["stray_bytes"]


def test_other_systems_on_the_line_are_not_taken_for_it() -> None:
    controller = Controller()
    controller.run(3)
    for system, component in ((8, 1), (7, 100), (255, 190)):
        other = common.MAVLink(None, srcSystem=system, srcComponent=component)
        frame = bytes(common.MAVLink_heartbeat_message(2, 12, 0, number_of(Mode.LAND), 4, 3).pack(other))
        controller.link.on_bytes(frame, controller.now_ns)
    assert controller.link.mode is Mode.HOLD
    assert controller.link.counts["of_others"] == 3


@pytest.mark.parametrize("count", [20_000, pytest.param(1_000_000, marks=[pytest.mark.slow, pytest.mark.timeout(900)])])
def test_hostile_frames_end_nothing_and_leave_positions_on_earth(count: int) -> None:
    random_, controller = stream(1, "hostile"), Controller()
    controller.run(2)
    classes = [common.mavlink_map[number] for number in (0, 1, 24, 33, 77, 111, 245, 253)]
    for _ in range(count):
        controller.now_ns += MS
        controller.link.on_bytes(mangled(random_, classes, controller.mav), controller.now_ns)
        controller.link.wake(controller.now_ns)
        decode(controller.link.out)
        controller.link.out = b""
        controller.link.events.clear()
        for reading in controller.link.readings:
            assert isinstance(reading, Battery) or all(math.isfinite(part) for part in reading.position)
        controller.link.readings.clear()
    assert controller.link.counts["bad_crc"] > count / 20


def mangled(random_: random.Random, classes: list[Any], mav: Any) -> bytes:
    known = random_.choice(classes)
    payload = random_.randbytes(known.unpacker.size)
    fields = known.unpacker.unpack(payload)
    try:
        ordered = [fields[known.orders[at]] for at in range(len(known.fieldnames))]
        frame = bytes(known(*ordered).pack(mav))
    except Exception:  # noqa: BLE001  (texts, arrays)
        frame = bytes(common.MAVLink_statustext_message(1, payload[:50]).pack(mav))
    if random_.random() < 0.3:
        at = random_.randrange(len(frame))
        frame = frame[:at] + bytes((random_.randrange(256),)) + frame[at + 1 :]
    return frame


async def test_pymavlink_is_met_over_a_serial_line() -> None:
    ours, theirs = pty.openpty()
    device = os.ttyname(theirs)
    link = AutopilotLink(flavor=Flavor.ARDUPILOT, origin=ORIGIN)
    now = asyncio.get_running_loop().time
    began_s = now()
    autopilot = Autopilot(
        "UAV 1",
        link,
        Address("serial", device, 921_600),
        now_ns=lambda: round((now() - began_s) * S),
        tell=lambda _: None,
    )
    await autopilot.connection.open()
    peer = ardupilotmega.MAVLink(None, srcSystem=3, srcComponent=1)
    os.set_blocking(ours, False)
    heard: list[str] = []
    try:
        for _ in range(60):
            os.write(ours, peer_heartbeat(peer))
            autopilot.tick()
            await asyncio.sleep(0.02)
            try:
                data = os.read(ours, 4096)
            except BlockingIOError:
                continue
            heard += [message.get_type() for message in peer.parse_buffer(data) or []]
            if {"HEARTBEAT", "COMMAND_LONG"} <= {*heard}:
                break
    finally:
        autopilot.connection.close()
        os.close(ours)
        os.close(theirs)
    assert link.system == 3
    assert {"HEARTBEAT", "COMMAND_LONG"} <= {*heard}


def peer_heartbeat(peer: Any) -> bytes:
    message = ardupilotmega.MAVLink_heartbeat_message(2, 3, 81, 4, 4, 3)
    return bytes(message.pack(peer))


def test_a_setpoint_that_is_no_number_is_counted_and_not_flown() -> None:
    link, names = AutopilotLink(flavor=Flavor.PX4, origin=ORIGIN), Topics("s")
    bus: Any = AutopilotBus(SimpleNamespace(), names, NodeId(1))
    bus.autopilot = SimpleNamespace(link=link)
    for east_m in (math.nan, math.inf):
        bus.put(names.setpoint(1), codecs.encode([Setpoint(0, Enu(east_m, 0.0, 50.0), 5.0)]))
    assert link.counts == {"setpoints_malformed": 2}


def test_what_a_flight_controller_says_before_the_swarms_clock_runs_is_not_kept() -> None:
    """A UAV may wait for hours for the swarm to begin; then it would fly through hours of fixes of one instant."""
    controller, runs = Controller(), False
    autopilot = Autopilot(
        "UAV 1", controller.link, Address("udpin", "127.0.0.1", 0), now_ns=lambda: controller.now_ns,
        tell=lambda _: None, hears=lambda: runs,
    )  # fmt: skip
    controller.tell = lambda message: autopilot.connection.said(None, bytes(message.pack(controller.mav)))  # type: ignore[method-assign]
    controller.run(10)
    assert not controller.link.readings
    runs = True
    controller.run(2)
    assert controller.link.readings
    assert not controller.link.counts["lost"]
