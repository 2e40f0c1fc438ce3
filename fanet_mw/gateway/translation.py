"""Speaks ArduPilot's tongue to a ground station that wants it; the UAVs of a swarm speak PX4's (`fanet_mw/flavors.py`).

HEARTBEAT            the autopilot and the number of the mode
SET_MODE, DO_SET_MODE    the number of the mode
NAV_TAKEOFF          its height counts from home, and not from the sea
MISSION_*            item 0 is home: the gateway shows it, and the vehicle never has it, so its numbers are one less
"""

from collections.abc import Callable
from typing import Any, Final

from fanet_mw.flavors import Flavor, Mode, mode_of, number_of
from fanet_mw.gateway.framing import Frame, frame_of, layout
from fanet_mw.mavlink import common, decode


def _again(message: Any, *, like: bytes) -> bytes:  # noqa: ANN401  (pymavlink has no types)
    """A message with the sender and the number of another frame."""
    mav = common.MAVLink(None, srcSystem=like[5], srcComponent=like[6])
    mav.seq = like[4]
    return bytes(message.pack(mav))


class Ardupilot:
    """The translation for one ground station link, which learns homes from what vehicles say on it."""

    def __init__(self) -> None:
        self._home: dict[int, tuple[int, int, float]] = {}
        """Latitude, longitude and height of the home of each vehicle, as it has told."""

    # --- from a vehicle -------------------------------------------------------------------------------------------

    def out(self, frame: bytes) -> bytes:
        """A vehicle's frame as a ground station is to get it."""
        message_id = int.from_bytes(frame[7:10], "little")
        change = self._OUT.get(message_id)
        if change is None:
            return frame
        (message,) = decode(frame)
        change(self, message, frame[5])
        return _again(message, like=frame)

    def _heartbeat(self, message: Any, _system: int) -> None:  # noqa: ANN401
        message.autopilot = common.MAV_AUTOPILOT_ARDUPILOTMEGA
        mode = mode_of(message.custom_mode)
        message.custom_mode = number_of(mode or Mode.HOLD, Flavor.ARDUPILOT)

    def _keep_home(self, message: Any, system: int) -> None:  # noqa: ANN401
        self._home[system] = message.latitude, message.longitude, message.altitude / 1000

    def _one_more(self, message: Any, _system: int) -> None:  # noqa: ANN401
        if message.mission_type == common.MAV_MISSION_TYPE_MISSION and message.count:
            message.count = _one_later(message.count)

    def _later(self, message: Any, _system: int) -> None:  # noqa: ANN401
        if getattr(message, "mission_type", 0) == common.MAV_MISSION_TYPE_MISSION:
            message.seq = _one_later(message.seq)
            if getattr(message, "command", 0) == common.MAV_CMD_DO_JUMP:
                message.param1 += 1

    def _current(self, message: Any, _system: int) -> None:  # noqa: ANN401
        if message.total not in (0, 0xFFFF):
            message.seq, message.total = _one_later(message.seq), _one_later(message.total)

    _OUT: Final[dict[int, Callable[["Ardupilot", Any, int], None]]] = {
        common.MAVLINK_MSG_ID_HEARTBEAT: _heartbeat,
        common.MAVLINK_MSG_ID_HOME_POSITION: _keep_home,
        common.MAVLINK_MSG_ID_MISSION_COUNT: _one_more,
        common.MAVLINK_MSG_ID_MISSION_REQUEST_INT: _later,
        common.MAVLINK_MSG_ID_MISSION_ITEM_INT: _later,
        common.MAVLINK_MSG_ID_MISSION_ITEM: _later,
        common.MAVLINK_MSG_ID_MISSION_ITEM_REACHED: _later,
        common.MAVLINK_MSG_ID_MISSION_CURRENT: _current,
    }

    # --- from a ground station ------------------------------------------------------------------------------------

    def into(self, frame: Frame) -> tuple[Frame | None, bytes]:
        """A ground station's frame as a vehicle is to get it, if it is to, and what the gateway answers itself."""
        if frame.message_id not in self._IN:
            return frame, b""
        (message,) = decode(frame.data)
        if message.get_type() == "SET_MODE":
            message.custom_mode = _px4(message.custom_mode)
        elif message.get_type() in ("COMMAND_LONG", "COMMAND_INT"):
            message = _command(message)
            if message is None:
                return frame, b""
        elif getattr(message, "mission_type", 0) == common.MAV_MISSION_TYPE_MISSION:
            return self._mission(message, frame)
        return _framed(_again(message, like=frame.data)), b""

    def _mission(self, message: Any, frame: Frame) -> tuple[Frame | None, bytes]:  # noqa: ANN401
        """Item 0 is home, which the gateway asks for and gives itself."""
        peer = frame.system, frame.component
        vehicle = bytes((0, 0, 0, 0, 0, frame.target, common.MAV_COMP_ID_AUTOPILOT1))
        kind = message.get_type()
        if kind == "MISSION_COUNT":
            message.count = max(0, message.count - 1)
        elif kind in ("MISSION_REQUEST_INT", "MISSION_REQUEST") and message.seq == 0:
            lat, lon, alt_m = self._home.get(frame.target, (0, 0, 0.0))
            place = (lat, lon, alt_m) if kind == "MISSION_REQUEST_INT" else (lat / 1e7, lon / 1e7, alt_m)
            makes = (
                common.MAVLink_mission_item_int_message if kind == "MISSION_REQUEST_INT"
                else common.MAVLink_mission_item_message
            )  # fmt: skip
            home = makes(*peer, 0, common.MAV_FRAME_GLOBAL, common.MAV_CMD_NAV_WAYPOINT, 0, 1, 0, 0, 0, 0, *place)
            return None, _again(home, like=vehicle)
        elif kind in ("MISSION_ITEM", "MISSION_ITEM_INT") and message.seq == 0:
            return None, b""  # the vehicle asks for its own item 0, which is 1 there
        elif hasattr(message, "seq"):
            message.seq = max(0, message.seq - 1)
            if getattr(message, "command", 0) == common.MAV_CMD_DO_JUMP and message.param1 > 0:
                message.param1 -= 1
        return _framed(_again(message, like=frame.data)), b""

    _IN: Final = frozenset({
        common.MAVLINK_MSG_ID_SET_MODE, common.MAVLINK_MSG_ID_COMMAND_LONG, common.MAVLINK_MSG_ID_COMMAND_INT,
        common.MAVLINK_MSG_ID_MISSION_COUNT, common.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
        common.MAVLINK_MSG_ID_MISSION_REQUEST, common.MAVLINK_MSG_ID_MISSION_ITEM_INT,
        common.MAVLINK_MSG_ID_MISSION_ITEM, common.MAVLINK_MSG_ID_MISSION_SET_CURRENT,
    })  # fmt: skip


def _one_later(number: int) -> int:
    return min(number + 1, 0xFFFF)


def _px4(number: int) -> int:
    """PX4's number for a mode of ArduPilot; for an unknown one a number that PX4 does not have, either."""
    mode = mode_of(number, Flavor.ARDUPILOT)
    return 0 if mode is None else number_of(Mode.GUIDED if mode is Mode.TAKEOFF else mode)


def _command(message: Any) -> Any:  # noqa: ANN401
    """A command that PX4 understands otherwise, changed; None for any other."""
    if message.command == common.MAV_CMD_DO_SET_MODE:
        number = _px4(int(message.param2)) if 0 <= message.param2 < 256 else 0
        message.param2, message.param3 = float(number >> 16 & 0xFF), float(number >> 24)
        return message
    if message.command == common.MAV_CMD_NAV_TAKEOFF and message.get_type() == "COMMAND_LONG":
        return common.MAVLink_command_int_message(
            message.target_system, message.target_component, common.MAV_FRAME_GLOBAL_RELATIVE_ALT, message.command, 0,
            0, message.param1, message.param2, message.param3, message.param4, 0x7FFF_FFFF, 0x7FFF_FFFF, message.param7,
        )  # fmt: skip
    if message.command == common.MAV_CMD_DO_SET_MISSION_CURRENT:
        if message.param1 > 0:  # home leads to the first item, and less than 0 names none
            message.param1 -= 1
        return message
    return None


def _framed(data: bytes) -> Frame:
    shape = layout(int.from_bytes(data[7:10], "little"))
    assert shape is not None, "it was made of a message that is known"
    return frame_of(data, shape)
