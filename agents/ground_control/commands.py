"""What each command of a ground station does: every COMMAND_LONG and COMMAND_INT is answered by a COMMAND_ACK."""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from agents.applications.telemetry_streams import TelemetryStreams
from agents.ground_control.pilot import Pilot
from agents.ground_control.plan_transfer import Peer
from agents.ground_control.plans import LEVEL_SPEEDS, USUAL_SPEED, Ground
from fanet_mw.flavors import Mode, mode_of
from fanet_mw.mavlink import common
from fanet_mw.units import US, Enu, S

_ACCEPTED: Final[int] = common.MAV_RESULT_ACCEPTED
_DENIED: Final[int] = common.MAV_RESULT_DENIED
_LATER: Final[int] = common.MAV_RESULT_TEMPORARILY_REJECTED
_UNSUPPORTED: Final[int] = common.MAV_RESULT_UNSUPPORTED
_MOST_US: Final = 1800 * 1_000_000  # MESSAGE_INTERVAL tells them in 31 bits
_NONE: Final = 0x7FFF_FFFF
"""A latitude or longitude that is not given (INT32_MAX)."""
_SAME_SPEED: Final = -1
"""In place of a speed: no change."""
_CHANGE_MODE: Final = 1
"""MAV_DO_REPOSITION_FLAGS_CHANGE_MODE."""
_AGAIN_NS: Final = 3 * S
"""A command that comes again within this time, in the same words of the same operator, is not carried out again."""
_PARAMS: Final = {
    "COMMAND_LONG": tuple(f"param{number}" for number in range(1, 8)),
    "COMMAND_INT": ("frame", "param1", "param2", "param3", "param4", "x", "y", "z"),
}
"""The parameters of a command, by the message that brings it."""
_QUESTIONS: Final = frozenset({
    common.MAV_CMD_SET_MESSAGE_INTERVAL, common.MAV_CMD_GET_MESSAGE_INTERVAL, common.MAV_CMD_REQUEST_MESSAGE,
    common.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
})  # fmt: skip


def is_question(number: int) -> bool:
    """True for a command that only asks to be told something."""
    return number in _QUESTIONS


def _is_whole(number: float, count: int) -> bool:
    """True for one of 0, 1, ..., count - 1."""
    return 0 <= number < count and number == int(number)


class Command(NamedTuple):
    """A command, by whichever of the two messages it came."""

    number: int
    params: tuple[float, float, float, float]
    x: int | None
    """Latitude [degrees x 1e7]; None: not given."""
    y: int | None
    z: float | None
    frame: int


def command_of(message: Any) -> Command | None:  # noqa: ANN401  (pymavlink has no types)
    """The command in a message, where NaN says that a number is not given; None if its place is none on earth. A
    COMMAND_LONG's place is in degrees over the sea.
    """
    params = (message.param1, message.param2, message.param3, message.param4)
    if message.get_type() == "COMMAND_INT":
        x, y = (None, None) if _NONE in (message.x, message.y) else (message.x, message.y)
        z, frame = message.z, message.frame
    else:
        lat, lon, z, frame = message.param5, message.param6, message.param7, common.MAV_FRAME_GLOBAL
        if abs(lat) > 90 or abs(lon) > 180:
            return None
        x, y = (None, None) if math.isnan(lat + lon) else (round(lat * 1e7), round(lon * 1e7))
    if math.isinf(z):
        return None
    return Command(message.command, params, x, y, None if math.isnan(z) else z, frame)


class Commands:
    """The commands of one vehicle."""

    def __init__(
        self,
        pilot: Pilot,
        streams: TelemetryStreams,
        ground: Callable[[], Ground],
        *,
        reply: Callable[[Any], None],
        send: Callable[[bytes], None],
        one: Callable[[int, int], bytes | None],
    ) -> None:
        """`reply` takes a message to be sent, `send` one that is packed already; `one` packs a stream's message now."""
        self._pilot, self._streams, self._ground = pilot, streams, ground
        self._reply, self._send, self._one = reply, send, one
        self._last_said: tuple[Any, ...] = ()
        """The latest command that was carried out: its sender, its kind, and its parameters."""
        self._last_ns = 0
        self._last_ack: Any = None
        self.paced = False
        """True while telemetry crosses the air, at a pace of its own that no ground station changes."""

    def on_command(self, message: Any, peer: Peer, now_ns: int) -> bool:  # noqa: ANN401
        """Carry out a command and acknowledge it; returns True for one repeated, which is only acknowledged again."""
        params = (repr(getattr(message, name)) for name in _PARAMS[message.get_type()])
        said = (peer, message.get_type(), message.command, *params)
        if said == self._last_said and now_ns - self._last_ns < _AGAIN_NS:
            self._reply(self._last_ack)
            return True
        command = command_of(message)
        does = self._DOES.get(message.command)
        if does is None:
            result = _UNSUPPORTED
        elif command is None:
            result = _DENIED
        else:
            result = self._change_to(does, now_ns) if isinstance(does, Mode) else does(self, command, now_ns)
        self._last_ack = common.MAVLink_command_ack_message(message.command, result, 0, 0, *peer)
        carried_out = result == _ACCEPTED and not is_question(message.command)
        self._last_said, self._last_ns = said if carried_out else (), now_ns
        self._reply(self._last_ack)
        return False

    def set_mode(self, number: int, now_ns: int) -> int:
        mode = mode_of(number)
        return _UNSUPPORTED if mode is None else self._change_to(mode, now_ns)

    def _change_to(self, mode: Mode, now_ns: int) -> int:
        pilot = self._pilot
        does: Mapping[Mode, Callable[[], bool]] = {
            Mode.HOLD: pilot.hold,
            Mode.TAKEOFF: lambda: pilot.take_off(None),
            Mode.MISSION: lambda: pilot.start_mission(now_ns),
            Mode.RETURN: pilot.go_home,
            Mode.LAND: pilot.land,
            Mode.GUIDED: pilot.guide,
        }
        return _ACCEPTED if does[mode]() else _LATER

    # --- flight ---------------------------------------------------------------------------------------------------

    def _arm(self, command: Command, _now_ns: int) -> int:
        wanted = command.params[0]
        if wanted not in (0, 1):
            return _DENIED
        return _ACCEPTED if (self._pilot.arm() if wanted else self._pilot.disarm()) else _LATER

    def _take_off(self, command: Command, _now_ns: int) -> int:
        up_m = None if command.z is None else self._ground().height(command.frame, command.z)
        if command.z is not None and up_m is None:
            return _DENIED
        return _ACCEPTED if self._pilot.take_off(up_m) else _LATER

    def _reposition(self, command: Command, _now_ns: int) -> int:
        place = self._place(command)
        if place is None or not self._pilot.allows(place):
            return _DENIED
        if not self._pilot.flies:
            return _LATER
        speed_m_s = command.params[0]
        if speed_m_s > 0 and not self._pilot.change_speed(speed_m_s):
            return _DENIED
        flags = command.params[1]
        guided = self._pilot.mode is Mode.GUIDED and not (0 < flags < 256 and int(flags) & _CHANGE_MODE)
        if math.isfinite(command.params[3]):
            self._streams.face(command.params[3])
        return _ACCEPTED if self._pilot.go_to(place, guided=guided) else _LATER

    def _place(self, command: Command) -> Enu | None:
        """Where a command leads; what it leaves out stays as it is."""
        ground, here = self._ground(), self._pilot.position
        up_m = here.up if command.z is None else ground.height(command.frame, command.z)
        if up_m is None:
            return None
        if command.x is None or command.y is None:
            return here._replace(up=up_m)
        place = ground.place(common.MAV_FRAME_GLOBAL, command.x, command.y, 0.0)
        return None if place is None else place._replace(up=up_m)

    def _speed(self, command: Command, _now_ns: int) -> int:
        kind, speed_m_s = command.params[:2]
        if kind not in LEVEL_SPEEDS:
            return _DENIED
        if speed_m_s == _SAME_SPEED:
            return _ACCEPTED
        wanted = None if speed_m_s == USUAL_SPEED else speed_m_s
        return _ACCEPTED if self._pilot.change_speed(wanted) else _DENIED

    def _yaw(self, command: Command, _now_ns: int) -> int:
        degrees, _, turn, relative = command.params
        if not math.isfinite(degrees):
            return _DENIED
        if self._pilot.on_ground:
            return _LATER
        way = math.radians(degrees if turn >= 0 else -degrees) if relative else math.radians(degrees)
        self._streams.face((self._streams.yaw or 0.0) + way if relative else way)
        return _ACCEPTED

    def _pause(self, command: Command, now_ns: int) -> int:
        if command.params[0] == 0:
            return self._change_to(Mode.HOLD, now_ns)
        return self._change_to(Mode.MISSION, now_ns) if command.params[0] == 1 else _DENIED

    def _set_current(self, command: Command, _now_ns: int) -> int:
        at = command.params[0]
        steps = self._pilot.mission.steps
        if not _is_whole(at, len(steps)):
            return _DENIED
        self._pilot.mission.go_to(int(at))
        return _ACCEPTED

    def _mode(self, command: Command, now_ns: int) -> int:
        base, main, sub = command.params[:3]
        if not (_is_whole(main, 256) and _is_whole(sub, 256) and base == base):
            return _DENIED
        return self.set_mode(int(main) << 16 | int(sub) << 24, now_ns)

    # --- what is told ---------------------------------------------------------------------------------------------

    def _set_interval(self, command: Command, now_ns: int) -> int:
        message_id, interval_us = command.params[:2]
        if not (_is_whole(message_id, 2**24) and -1 <= interval_us <= _MOST_US):
            return _DENIED
        if self.paced:
            return _DENIED
        interval_ns = None if interval_us == 0 else round(interval_us) * US
        return _ACCEPTED if self._streams.set_interval(int(message_id), interval_ns, now_ns) else _DENIED

    def _get_interval(self, command: Command, _now_ns: int) -> int:
        message_id = command.params[0]
        if not _is_whole(message_id, 2**16):
            return _DENIED
        interval_ns = self._streams.interval_ns(int(message_id))
        interval_us = 0 if interval_ns is None else -1 if not interval_ns else interval_ns // US
        self._reply(common.MAVLink_message_interval_message(int(message_id), interval_us))
        return _ACCEPTED

    def _request(self, command: Command, now_ns: int) -> int:
        message_id = command.params[0]
        frame = self._one(int(message_id), now_ns) if _is_whole(message_id, 2**24) else None
        if frame is None:
            return _DENIED
        self._send(frame)
        return _ACCEPTED

    def _version(self, command: Command, now_ns: int) -> int:
        if command.params[0] != 1:
            return _DENIED
        return self._request(command._replace(params=(common.MAVLINK_MSG_ID_AUTOPILOT_VERSION, 0, 0, 0)), now_ns)

    _DOES: Final[Mapping[int, Mode | Callable[[Any, Command, int], int]]] = {
        common.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
        common.MAV_CMD_NAV_TAKEOFF: _take_off,
        common.MAV_CMD_NAV_LAND: Mode.LAND,
        common.MAV_CMD_NAV_RETURN_TO_LAUNCH: Mode.RETURN,
        common.MAV_CMD_NAV_LOITER_UNLIM: Mode.HOLD,
        common.MAV_CMD_DO_REPOSITION: _reposition,
        common.MAV_CMD_DO_CHANGE_SPEED: _speed,
        common.MAV_CMD_CONDITION_YAW: _yaw,
        common.MAV_CMD_DO_PAUSE_CONTINUE: _pause,
        common.MAV_CMD_MISSION_START: Mode.MISSION,
        common.MAV_CMD_DO_SET_MISSION_CURRENT: _set_current,
        common.MAV_CMD_DO_SET_MODE: _mode,
        common.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
        common.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
        common.MAV_CMD_REQUEST_MESSAGE: _request,
        common.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _version,
    }
