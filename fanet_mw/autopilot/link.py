"""The link of a companion computer to one flight controller, PX4 or ArduPilot (docs/how-to/flight-controllers.md).
Sans-IO.

    in     its MAVLink (`on_bytes`), the setpoints of the computer (`command`), time (`wake`)
    out    MAVLink for it (`out`), what it measures for the computer (`readings`), what happened (`events`)

Commands go out one at a time, each again until it is acknowledged. Heights are over home.
"""

import math
from collections import Counter, deque
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from fanet_mw.bus.messages import VELOCITY_LASTS_NS, Battery, FlightState, Gps, Setpoint, SetpointKind
from fanet_mw.errors import MalformedFrameError
from fanet_mw.flavors import Flavor, Mode, mode_of, number_of
from fanet_mw.gateway.framing import Framing
from fanet_mw.mavlink import AUTOPILOT_COMPONENT, Geodetic, Ned, common, decode, from_ned, to_enu, to_geodetic, to_ned
from fanet_mw.units import MS, STILL, Enu, S
from fanet_mw.wire import COMPONENT

SETPOINT_NS: Final = 250 * MS
"""The interval of setpoints: PX4 leaves OFFBOARD without one for 0.5 s, ArduPilot GUIDED's velocities last for 3 s."""
LOST_NS: Final = 3 * S
"""A flight controller that is not heard for so long is lost."""
_HEARTBEAT_NS: Final = S
_AGAIN_NS: Final = S
_MOST_TIMES: Final = 3
_LEAD_SETPOINTS: Final = 3
"""Setpoints that flow before the guided mode is asked for; PX4 refuses it without."""
_STREAMS: Final = {
    common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 200 * MS, common.MAVLINK_MSG_ID_GPS_RAW_INT: S,
    common.MAVLINK_MSG_ID_SYS_STATUS: S, common.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: S,
    common.MAVLINK_MSG_ID_ATTITUDE: 200 * MS, common.MAVLINK_MSG_ID_SYSTEM_TIME: S,
}  # fmt: skip
"""What is asked for, and how often."""
_3D_FIX: Final = 3
_UNKNOWN_U16: Final = 65_535
_FIRST_GPS_UNIX_US: Final = 315_964_800_000_000
"""1980-01-06: what claims to be earlier is no time of GPS."""
_LAST_UNIX_US: Final = 1 << 52
"""The year 2112."""
_POSITION_MASK: Final = 0b110111111000
_VELOCITY_MASK: Final = 0b110111000111
_MISSING: Final = (_UNKNOWN_U16, -1)
_STREAM: Final = common.MAV_CMD_SET_MESSAGE_INTERVAL
_MODE: Final = common.MAV_CMD_DO_SET_MODE
_SPEED: Final = common.MAV_CMD_DO_CHANGE_SPEED
_TAKES_OFF: Final = (_MODE, common.MAV_CMD_COMPONENT_ARM_DISARM, common.MAV_CMD_NAV_TAKEOFF)


class _Waiting(NamedTuple):
    """A command that is not acknowledged yet."""

    command: int
    params: tuple[float, ...]
    what: str


Reading = Gps | Battery | FlightState


class AutopilotLink:
    """One flight controller."""

    def __init__(self, *, flavor: Flavor, origin: Geodetic) -> None:
        self._flavor, self._origin = flavor, origin
        self.counts: Counter[str] = Counter()
        self.out = b""
        self.readings: list[Reading] = []
        self.events: list[str] = []
        self.system: int | None = None
        """Its MAVLink system; None before it was heard."""
        self.mode: Mode | None = None
        """Its mode, if it is one that is known here."""
        self.armed = False
        self.on_ground: bool | None = None
        self.lost = False
        self.position: Enu | None = None
        """Its position by its own estimate, in the swarm's frame, up from home."""
        self.velocity = STILL
        self.unix_off_ns: int | None = None
        """Its unix time less swarm time; None: it knows no time of GPS."""
        self.yielded = False
        """True while it flies by itself or by a pilot, and is not commanded."""
        self._guided = False
        """True once it was in the guided mode because it was asked to be."""
        self._framing = Framing(self.counts)
        self._mav: Any = None
        self._heard_ns = 0
        self._beat_ns: int | None = None
        self._home_amsl_m = 0.0
        self._fix_type, self._satellites = _3D_FIX, 255
        self._hdop: float | None = None
        self._waiting: deque[_Waiting] = deque()
        self._sent_ns, self._times = 0, 0
        self._wanted: Setpoint | None = None
        self._unsaid = False
        """True while what the computer wants has not been asked for, because it could not be."""
        self._hold: Enu | None = None
        self._setpoint_ns = 0
        self._streamed = 0
        self._speed_m_s: float | None = None
        """The speed that it was asked for last; None: none, or that question has been dropped or forgotten."""

    # --- in -------------------------------------------------------------------------------------------------------

    def on_bytes(self, data: bytes, now_ns: int) -> None:
        """Some bytes of its connection; not even a datagram need begin or end with a frame, as bridges cut anywhere."""
        for frame in self._framing.frames(data):
            if frame.component != AUTOPILOT_COMPONENT or self.system not in (None, frame.system):
                self.counts["of_others"] += 1
                continue
            try:
                (message,) = decode(frame.data)
            except MalformedFrameError:
                self.counts["malformed"] += 1
                continue
            handle = self._HANDLERS.get(message.get_type())
            if handle is not None and (self.system is not None or message.get_type() == "HEARTBEAT"):
                handle(self, message, now_ns)

    def _on_heartbeat(self, message: Any, now_ns: int) -> None:  # noqa: ANN401  (pymavlink has no types)
        if message.autopilot == common.MAV_AUTOPILOT_INVALID:
            return
        if self.system is None:
            self.system = message.get_srcSystem()
            self._mav = common.MAVLink(None, srcSystem=self.system, srcComponent=COMPONENT)
            self.events.append(f"flight controller {self.system} heard")
            self._ask_streams()
        if self.lost:
            self.lost = False
            self.events.append("flight controller heard again")
            self._ask_streams()  # it may have started again
            self._speed_m_s = None
        self._heard_ns = now_ns
        self.armed = bool(message.base_mode & common.MAV_MODE_FLAG_SAFETY_ARMED)
        before, self.mode = self.mode, mode_of(message.custom_mode, self._flavor)
        if self.mode is Mode.GUIDED:
            if self.yielded:
                self.events.append("back in the guided mode: commanding again")
            self._guided, self.yielded = True, False
        elif self._guided and before is Mode.GUIDED and not self._asked_to_leave:
            self.yielded, self._guided = True, False
            self._drop(lambda one: one.command != _STREAM)
            self.events.append(f"left the guided mode for {self.mode or message.custom_mode}: left alone")
        if self._unsaid and self._wanted is not None and self._can_be_asked(self._wanted):
            self._unsaid = False
            self._ask_for(self._wanted)

    def _can_be_asked(self, wanted: Setpoint) -> bool:
        """False while it is lost or left alone; before it knows its place it has no height to take off to."""
        takes_off = wanted.kind is SetpointKind.TAKEOFF
        return not self.yielded and not self.lost and not (takes_off and self.position is None)

    @property
    def _asked_to_leave(self) -> bool:
        """True if the setpoint in force asks for another mode than the guided one."""
        wanted = self._wanted
        return wanted is not None and wanted.kind in (SetpointKind.LAND, SetpointKind.RETURN, SetpointKind.TAKEOFF)

    def _on_position(self, message: Any, now_ns: int) -> None:  # noqa: ANN401
        if abs(message.lat) > 900_000_000 or abs(message.lon) > 1_800_000_000 or (not message.lat and not message.lon):
            self.counts["no_position"] += 1
            return
        place = to_enu(Geodetic(message.lat / 1e7, message.lon / 1e7, self._origin.alt_m), self._origin)
        self._home_amsl_m = (message.alt - message.relative_alt) / 1000
        self.position = Enu(place.east, place.north, message.relative_alt / 1000)
        self.velocity = from_ned(Ned(message.vx / 100, message.vy / 100, message.vz / 100))
        if self._fix_type >= _3D_FIX:
            self.readings.append(Gps(now_ns, self.position, self.velocity))
        else:
            self.counts["no_fix"] += 1

    def _on_gps(self, message: Any, _now_ns: int) -> None:  # noqa: ANN401
        self._fix_type, self._satellites = message.fix_type, message.satellites_visible
        self._hdop = None if message.eph == _UNKNOWN_U16 else message.eph / 100

    def _on_attitude(self, message: Any, now_ns: int) -> None:  # noqa: ANN401
        angles = message.roll, message.pitch, message.yaw
        if not all(map(math.isfinite, angles)):
            self.counts["no_attitude"] += 1
            return
        unix_ns = 0 if self.unix_off_ns is None else now_ns + self.unix_off_ns
        self.readings.append(FlightState(now_ns, *angles, self._satellites, self._hdop, unix_ns))

    def _on_time(self, message: Any, now_ns: int) -> None:  # noqa: ANN401
        known = _FIRST_GPS_UNIX_US < message.time_unix_usec < _LAST_UNIX_US
        self.unix_off_ns = 1000 * message.time_unix_usec - now_ns if known else None

    def _on_status(self, message: Any, now_ns: int) -> None:  # noqa: ANN401
        if message.voltage_battery not in _MISSING and message.battery_remaining >= 0:
            current_a = max(0.0, message.current_battery / 100)
            charge = min(1.0, message.battery_remaining / 100)
            self.readings.append(Battery(now_ns, message.voltage_battery / 1000, current_a, charge))

    def _on_landed(self, message: Any, _now_ns: int) -> None:  # noqa: ANN401
        self.on_ground = message.landed_state == common.MAV_LANDED_STATE_ON_GROUND

    def _on_ack(self, message: Any, now_ns: int) -> None:  # noqa: ANN401
        if not self._waiting or message.command != self._waiting[0].command:
            return
        if message.target_system not in (0, self.system) or message.target_component not in (0, COMPONENT):
            self.counts["answers_to_others"] += 1
            return
        if message.result == common.MAV_RESULT_IN_PROGRESS:
            self._sent_ns = now_ns
            return
        done = self._waiting.popleft()
        self._times = 0
        if message.result == common.MAV_RESULT_ACCEPTED:
            self.counts["accepted"] += 1
        else:
            self.counts["refused"] += 1
            self.events.append(f"refused ({message.result}): {done.what}")

    def _on_text(self, message: Any, _now_ns: int) -> None:  # noqa: ANN401
        text = "".join(letter for letter in str(message.text) if letter.isprintable())
        self.events.append(f"says: {text}")

    def _on_timesync(self, message: Any, now_ns: int) -> None:  # noqa: ANN401
        if not message.tc1:
            self._say(common.MAVLink_timesync_message(now_ns, message.ts1))

    _HANDLERS: Final = {
        "HEARTBEAT": _on_heartbeat,
        "GLOBAL_POSITION_INT": _on_position,
        "GPS_RAW_INT": _on_gps,
        "SYS_STATUS": _on_status,
        "ATTITUDE": _on_attitude,
        "SYSTEM_TIME": _on_time,
        "EXTENDED_SYS_STATE": _on_landed,
        "COMMAND_ACK": _on_ack,
        "STATUSTEXT": _on_text,
        "TIMESYNC": _on_timesync,
    }

    def command(self, setpoint: Setpoint, now_ns: int) -> None:
        """What the UAV's computer wants to be flown from now on."""
        before, self._wanted = self._wanted, setpoint
        kind = setpoint.kind
        again = before is not None and before.kind is kind and before.position == setpoint.position
        if again and before is not None and kind is SetpointKind.POSITION:
            again = before.speed_m_s == setpoint.speed_m_s
        if kind is SetpointKind.HOLD or (kind is SetpointKind.POSITION and setpoint.speed_m_s <= 0):
            self._hold = self.position if self._hold is None else self._hold
        else:
            self._hold = None
        if again:
            return
        self._unsaid = not self._can_be_asked(setpoint)
        if not self._unsaid:
            self._ask_for(setpoint)
            self._setpoint_ns = min(self._setpoint_ns, now_ns)

    def _ask_for(self, setpoint: Setpoint) -> None:
        """The commands that a setpoint needs, instead of those for the one before."""
        kind = setpoint.kind
        if kind is SetpointKind.TAKEOFF:
            self._take_off(setpoint.position.up)
        elif kind in (SetpointKind.LAND, SetpointKind.RETURN):
            said = self._waiting[0] if self._waiting and self._times else None
            self._drop(lambda one: one.command in _TAKES_OFF and not (one is said and one.command == _MODE))
            self._ask_mode(Mode.LAND if kind is SetpointKind.LAND else Mode.RETURN)
        elif kind is SetpointKind.POSITION and setpoint.speed_m_s > 0 and setpoint.speed_m_s != self._speed_m_s:
            self._speed_m_s = setpoint.speed_m_s
            self._ask(_SPEED, (1, setpoint.speed_m_s, -1), f"speed {setpoint.speed_m_s:g} m/s")

    def _take_off(self, up_m: float) -> None:
        streams = [one for one in self._waiting if one.command == _STREAM]
        self._drop(lambda _: True)
        if self._flavor is Flavor.ARDUPILOT:
            self._ask_mode(Mode.GUIDED)
        self._ask(common.MAV_CMD_COMPONENT_ARM_DISARM, (1,), "arm")
        height_m = up_m + (self._home_amsl_m if self._flavor is Flavor.PX4 else 0.0)
        self._ask(
            common.MAV_CMD_NAV_TAKEOFF, (0, 0, 0, math.nan, math.nan, math.nan, height_m), f"take-off to {up_m:g} m"
        )
        self._waiting += streams

    # --- time -----------------------------------------------------------------------------------------------------

    def wake(self, now_ns: int) -> None:
        """To be called at least as often as setpoints go out."""
        if self.system is None:
            return
        if not self.lost and now_ns - self._heard_ns > LOST_NS:
            self.lost = True
            self.counts["lost"] += 1
            self.events.append(f"flight controller not heard for {LOST_NS // S} s")
        if self._beat_ns is None or now_ns >= self._beat_ns:
            self._beat_ns = now_ns + _HEARTBEAT_NS
            kind, none, active = (
                common.MAV_TYPE_ONBOARD_CONTROLLER,
                common.MAV_AUTOPILOT_INVALID,
                common.MAV_STATE_ACTIVE,
            )
            self._say(common.MAVLink_heartbeat_message(kind, none, 0, 0, active, 3))
        if self.lost:
            return
        self._repeat(now_ns)
        if now_ns >= self._setpoint_ns:
            self._setpoint_ns = now_ns + SETPOINT_NS
            self._stream(now_ns)

    def _repeat(self, now_ns: int) -> None:
        """Send the command that waits, again if it was not acknowledged."""
        if not self._waiting or (self._times and now_ns - self._sent_ns < _AGAIN_NS):
            return
        if self._times >= _MOST_TIMES:
            self.counts["unanswered"] += 1
            self.events.append(f"no answer: {self._waiting.popleft().what}")
            self._times = 0
            return
        waiting = self._waiting[0]
        seven = [*waiting.params, *[0.0] * (7 - len(waiting.params))]
        message = common.MAVLink_command_long_message(
            self.system, AUTOPILOT_COMPONENT, waiting.command, self._times, *seven
        )
        self._say(message)
        self._sent_ns = now_ns
        self._times += 1

    def _stream(self, now_ns: int) -> None:
        """The setpoint that is in force."""
        wanted = self._wanted
        if wanted is None or self.yielded or self._asked_to_leave or self.position is None:
            self._streamed = 0
            return
        if wanted.kind is SetpointKind.VELOCITY and now_ns - wanted.t_ns <= VELOCITY_LASTS_NS:
            self._say_velocity(wanted.velocity, now_ns)
        else:
            if wanted.kind is SetpointKind.VELOCITY and self._hold is None:
                self._hold = self.position
                self.events.append("no more velocities: holding")
            self._say_position(self._hold or wanted.position, now_ns)
        self._streamed += 1
        if self._streamed == _LEAD_SETPOINTS and self.mode is not Mode.GUIDED:
            self._ask_mode(Mode.GUIDED)

    def _say_position(self, place: Enu, now_ns: int) -> None:
        at = to_geodetic(Enu(place.east, place.north, 0.0), self._origin)
        self._say(
            common.MAVLink_set_position_target_global_int_message(
                now_ns // MS & 0xFFFF_FFFF, self.system, AUTOPILOT_COMPONENT,
                common.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, _POSITION_MASK, round(at.lat_deg * 1e7),
                round(at.lon_deg * 1e7), place.up, 0, 0, 0, 0, 0, 0, 0, 0,
            )
        )  # fmt: skip

    def _say_velocity(self, velocity: Enu, now_ns: int) -> None:
        ned = to_ned(velocity)
        self._say(
            common.MAVLink_set_position_target_local_ned_message(
                now_ns // MS & 0xFFFF_FFFF, self.system, AUTOPILOT_COMPONENT, common.MAV_FRAME_LOCAL_NED,
                _VELOCITY_MASK, 0, 0, 0, *ned, 0, 0, 0, 0, 0,
            )
        )  # fmt: skip

    def _ask_mode(self, mode: Mode) -> None:
        number = number_of(mode, self._flavor)
        if self._flavor is Flavor.PX4:
            params: tuple[float, ...] = (1, number >> 16 & 0xFF, number >> 24)
        else:
            params = (1, number)
        self._ask(_MODE, params, f"mode {mode}", first=True)

    def _ask_streams(self) -> None:
        for message_id, interval_ns in _STREAMS.items():
            self._ask(_STREAM, (message_id, interval_ns / 1000), f"message {message_id} every {interval_ns / MS:g} ms")

    def _drop(self, is_over: Callable[[_Waiting], bool]) -> None:
        """Ask no more for what nobody wants any longer."""
        first = self._waiting[0] if self._waiting else None
        if any(one.command == _SPEED and is_over(one) for one in self._waiting):
            self._speed_m_s = None
        self._waiting = deque(one for one in self._waiting if not is_over(one))
        if not self._waiting or self._waiting[0] is not first:
            self._times = 0

    def _ask(self, command: int, params: tuple[float, ...], what: str, *, first: bool = False) -> None:
        """Put a command into the line, unless it waits there already; `first`: before the others, but after one of its
        kind that was sent, whose answer would be taken for its own.
        """
        waiting = _Waiting(command, params, what)
        if any(other.what == what for other in self._waiting):
            return
        if first and self._times and self._waiting[0].command == command:
            self._waiting.insert(1, waiting)
        elif first:
            self._waiting.appendleft(waiting)
            self._times = 0
        else:
            self._waiting.append(waiting)

    def _say(self, message: Any) -> None:  # noqa: ANN401
        self.out += bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
