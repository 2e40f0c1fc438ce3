"""Native MAVLink messages, and the only module that knows NED. The border to pymavlink; places on earth: `geodesy.py`.

Inside, positions are ENU metres in the plane that touches the WGS84 ellipsoid at an origin. Outside are degrees x 1e7,
millimetres of height, and velocities north, east, down in cm/s. Conversions use the earth-centered frame and are exact;
the rounding in a message is below 1 cm. `mavutil` is not imported, because it loads every dialect.

Not modeled: geoid height (altitudes are over the ellipsoid), and the turn of the axes with distance (velocities and
headings refer to north and east at the origin: 0.1 degrees off at 10 km).
"""

import math
import re
from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache, partial
from importlib import metadata
from types import ModuleType
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import common as common  # others take MAVLink's names and messages from here

from fanet_mw.dialect import fanet
from fanet_mw.errors import LocalProtocolError, MalformedFrameError
from fanet_mw.flavors import Mode, number_of
from fanet_mw.geodesy import ORIGIN as ORIGIN
from fanet_mw.geodesy import Geodetic as Geodetic
from fanet_mw.geodesy import to_enu as to_enu
from fanet_mw.geodesy import to_geodetic as to_geodetic
from fanet_mw.units import MAX_NODES, MS, US, Enu, NodeId
from fanet_mw.wire import COMPONENT, Packed, frames, inner_frames, renumbered, system_id

common.mavlink_map.update(fanet.mavlink_map)  # one parser decodes both dialects

COLLISION_ID: Final = int(common.MAVLINK_MSG_ID_COLLISION)
GLOBAL_POSITION_ID: Final = int(common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
AUTOPILOT_COMPONENT: Final = 1
"""MAV_COMP_ID_AUTOPILOT1, the sender of telemetry: ground stations take no other component for a vehicle."""
GATEWAY_COMPONENT: Final = 240
"""MAV_COMP_ID_UDP_BRIDGE, by which a gateway tells UAVs that ground stations may be there."""

LANDED_IN_AIR: Final = int(common.MAV_LANDED_STATE_IN_AIR)
_HEALTHY: Final = int(
    common.MAV_SYS_STATUS_SENSOR_3D_GYRO | common.MAV_SYS_STATUS_SENSOR_3D_ACCEL | common.MAV_SYS_STATUS_SENSOR_3D_MAG
    | common.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE | common.MAV_SYS_STATUS_AHRS | common.MAV_SYS_STATUS_PREARM_CHECK
)  # fmt: skip
"""What a simulated flight controller is never without."""

_CAPABILITIES: Final = int(
    common.MAV_PROTOCOL_CAPABILITY_MISSION_INT | common.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | common.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT | common.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | common.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY | common.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | common.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | common.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
)  # fmt: skip
_FOUND_ADDRESS: Final = 0x400000
"""The first ADS-B address of survivors; MAVProxy draws those of this range as flags."""
_MOST_FINDS: Final = 0x100000
_CALLSIGN: Final = 8
_FOUND_FLAGS: Final = int(
    common.ADSB_FLAGS_VALID_COORDS | common.ADSB_FLAGS_VALID_ALTITUDE | common.ADSB_FLAGS_VALID_CALLSIGN
    | common.ADSB_FLAGS_VALID_VELOCITY
)  # fmt: skip
_UNKNOWN_U16: Final = 0xFFFF
_UNKNOWN_I16: Final = 0x7FFF
_GPS_NO_FIX: Final = 1
_GPS_3D_FIX: Final = 3


# --- coordinates --------------------------------------------------------------------------------------------------


class Ned(NamedTuple):
    """A vector in north, east, down; metres, or metres per second."""

    north: float
    east: float
    down: float


def to_ned(vector: Enu) -> Ned:
    return Ned(vector.north, vector.east, -vector.up)


def from_ned(vector: Ned) -> Enu:
    return Enu(vector.east, vector.north, -vector.down)


def _place_ints(place: Geodetic) -> tuple[int, int, int]:
    """Latitude and longitude [degrees x 1e7], altitude [mm]."""
    return round(place.lat_deg * 1e7), round(place.lon_deg * 1e7), _millimeters(place.alt_m)


def _millimeters(height_m: float) -> int:
    """A height in the 32 bits that MAVLink has for it, limited to 2,147 km."""
    return max(-0x8000_0000, min(0x7FFF_FFFF, round(height_m * 1000)))


def _velocity_ints(velocity: Enu) -> tuple[int, int, int]:
    """North, east, down [cm/s]."""
    north, east, down = (max(-0x8000, min(0x7FFF, round(100 * part))) for part in to_ned(velocity))
    return north, east, down


def _centidegrees(angle_rad: float | None) -> int:
    """A course in [0, 36000); 65535 when there is none."""
    return _UNKNOWN_U16 if angle_rad is None else round(math.degrees(angle_rad) * 100) % 36000


# --- messages -----------------------------------------------------------------------------------------------------


class Attitude(NamedTuple):
    """Rotations from north, east, down to forward, right, down [rad]; yaw is clockwise from north."""

    roll: float
    pitch: float
    yaw: float


class BatteryState(NamedTuple):
    """The state of a battery whose cells are not measured one by one."""

    voltage_v: float
    current_a: float
    consumed_mah: int
    remaining_percent: int


def _battery_fields(battery: BatteryState | None) -> tuple[int, int, int, int]:
    """Voltage [mV], current [cA], consumed charge [mAh] and what remains [%], or what MAVLink says for unknown."""
    if battery is None:
        return _UNKNOWN_U16, -1, -1, -1
    millivolts = max(0, min(_UNKNOWN_U16 - 1, round(1000 * battery.voltage_v)))
    centiamperes = max(0, min(_UNKNOWN_I16, round(100 * battery.current_a)))
    return millivolts, centiamperes, battery.consumed_mah, battery.remaining_percent


class Encoder:
    """Makes the native messages of one node, as MAVLink 2 frames with a sequence of their own."""

    def __init__(self, node: NodeId, *, component: int = COMPONENT, origin: Geodetic = ORIGIN) -> None:
        self._sender = system_id(node), component
        self._origin = origin

    @cached_property
    def _mav(self) -> Any:  # noqa: ANN401  (pymavlink has no types)
        """The state of the sender; it takes a while to make, and many encoders are never used."""
        system, component = self._sender
        return common.MAVLink(None, srcSystem=system, srcComponent=component)

    @cached_property
    def _heartbeat(self) -> bytes:
        mode = common.MAV_MODE_FLAG_SAFETY_ARMED | common.MAV_MODE_FLAG_AUTO_ENABLED
        heartbeat = common.MAVLink_heartbeat_message(
            common.MAV_TYPE_QUADROTOR, common.MAV_AUTOPILOT_GENERIC, mode, 0, common.MAV_STATE_ACTIVE, 3
        )
        return bytes(heartbeat.pack(self._mav))

    def pack(self, message: Any) -> bytes:  # noqa: ANN401  (pymavlink has no types)
        data = bytes(message.pack(self._mav))
        self._count()
        return data

    def _renumber(self, frame: bytes) -> bytes:
        """A frame whose message never changes, with the next sequence number: to pack it each time takes far longer."""
        data = renumbered(frame, self._mav.seq)
        self._count()
        return data

    def _count(self) -> None:
        self._mav.seq = (self._mav.seq + 1) % 256  # `pack` leaves this to `send`, which needs a file

    def heartbeat(self) -> bytes:
        """HEARTBEAT: armed and autonomous. GENERIC, because INVALID would mean that there is no flight controller."""
        return self._renumber(self._heartbeat)

    def vehicle_heartbeat(self, mode: Mode, *, armed: bool, critical: bool = False) -> bytes:
        """HEARTBEAT of a flight controller with PX4's modes."""
        base = common.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | common.MAV_MODE_FLAG_STABILIZE_ENABLED
        base |= common.MAV_MODE_FLAG_GUIDED_ENABLED
        base |= 0 if mode is Mode.GUIDED else common.MAV_MODE_FLAG_AUTO_ENABLED
        base |= common.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        state = common.MAV_STATE_ACTIVE if armed else common.MAV_STATE_STANDBY
        return self.pack(
            common.MAVLink_heartbeat_message(
                common.MAV_TYPE_QUADROTOR, common.MAV_AUTOPILOT_PX4, base, number_of(mode),
                common.MAV_STATE_CRITICAL if critical else state, 3,
            )
        )  # fmt: skip

    def local_position(self, position: Enu, velocity: Enu, *, now_ns: int) -> bytes:
        """LOCAL_POSITION_NED: relative to the origin of the swarm."""
        ned, moves = to_ned(position), to_ned(velocity)
        return self.pack(common.MAVLink_local_position_ned_message(_boot_ms(now_ns), *ned, *moves))

    def survivor(self, survivor: int, at: Enu) -> bytes:
        """ADSB_VEHICLE: a survivor, as something on the surface that ground stations draw with its name."""
        lat, lon, height_mm = _place_ints(to_geodetic(at, self._origin))
        name = f"FOUND{survivor}"[:_CALLSIGN] if survivor < 1000 else "PERSON"
        return self.pack(
            common.MAVLink_adsb_vehicle_message(
                _FOUND_ADDRESS + survivor % _MOST_FINDS, lat, lon, common.ADSB_ALTITUDE_TYPE_GEOMETRIC, height_mm, 0, 0,
                0, name.encode(), common.ADSB_EMITTER_TYPE_EMERGENCY_SURFACE, 0, _FOUND_FLAGS, 0,
            )
        )  # fmt: skip

    def vfr_hud(self, position: Enu, velocity: Enu, *, airspeed_m_s: float, yaw: float | None) -> bytes:
        ground_m_s = velocity.horizontal()
        heading = 0 if yaw is None else round(math.degrees(yaw)) % 360
        alt_m = to_geodetic(position, self._origin).alt_m
        return self.pack(common.MAVLink_vfr_hud_message(airspeed_m_s, ground_m_s, heading, 0, alt_m, velocity.up))

    def mission_current(self, at: int, *, items: int, flies: bool) -> bytes:
        """MISSION_CURRENT; without items the mission is the swarm's own task, of which MAVLink knows nothing."""
        over = bool(items) and at >= items
        state = (
            common.MISSION_STATE_NO_MISSION if not items
            else common.MISSION_STATE_COMPLETE if over
            else common.MISSION_STATE_ACTIVE if flies
            else common.MISSION_STATE_PAUSED if at
            else common.MISSION_STATE_NOT_STARTED
        )  # fmt: skip
        shown = max(0, min(at, items - 1))
        return self.pack(common.MAVLink_mission_current_message(shown, items or _UNKNOWN_U16, state, int(flies)))

    def system_time(self, now_ns: int, *, unix_ns: int = 0) -> bytes:
        """SYSTEM_TIME: unix time; 0: swarm time, counted from 1970 by a swarm that knows no other epoch."""
        return self.pack(common.MAVLink_system_time_message((unix_ns or now_ns) // US, _boot_ms(now_ns)))

    def radio_status(self, rssi_dbm: float | None, lost: int) -> bytes:
        """RADIO_STATUS as SiK radios give it: 1.9 x (dBm + 127); 0: nobody is heard."""
        rssi = 0 if rssi_dbm is None else max(1, min(254, round(1.9 * (rssi_dbm + 127))))
        return self.pack(common.MAVLink_radio_status_message(rssi, rssi, 100, 0, 0, lost & 0xFFFF, 0))

    def autopilot_version(self, node: NodeId) -> bytes:
        """AUTOPILOT_VERSION: what this vehicle can do; its identification is its node."""
        version = tuple(int(part) for part in re.findall(r"\d+", metadata.version("fanet-mw"))[:3])
        number = sum(part << shift for part, shift in zip(version, (24, 16, 8), strict=False))
        return self.pack(
            common.MAVLink_autopilot_version_message(
                _CAPABILITIES, number, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, node
            )
        )

    def global_position(
        self, position: Enu, velocity: Enu, *, yaw: float | None, now_ns: int, home_m: float = 0.0
    ) -> bytes:
        """GLOBAL_POSITION_INT; the relative altitude is that over a place so high above the origin."""
        place = to_geodetic(position, self._origin)
        lat, lon, alt_mm = _place_ints(place)
        relative_mm = _millimeters(place.alt_m - self._origin.alt_m - home_m)
        velocities = _velocity_ints(velocity)
        return self.pack(
            common.MAVLink_global_position_int_message(
                _boot_ms(now_ns), lat, lon, alt_mm, relative_mm, *velocities, _centidegrees(yaw)
            )
        )

    def gps_raw(
        self,
        position: Enu,
        velocity: Enu,
        *,
        has_fix: bool,
        fix_ns: int,
        satellites: int = 255,
        hdop: float | None = None,
    ) -> bytes:
        """GPS_RAW_INT: the last reading of the receiver; 255 satellites and no `hdop`: its quality is not known."""
        ground_m_s = velocity.horizontal()
        course = math.atan2(velocity.east, velocity.north) if ground_m_s else None
        return self.pack(
            common.MAVLink_gps_raw_int_message(
                max(0, fix_ns // US),
                _GPS_3D_FIX if has_fix else _GPS_NO_FIX,
                *_place_ints(to_geodetic(position, self._origin)),
                _UNKNOWN_U16 if hdop is None else max(0, min(round(100 * hdop), _UNKNOWN_U16 - 1)),
                _UNKNOWN_U16,
                min(round(100 * ground_m_s), _UNKNOWN_U16 - 1),
                _centidegrees(course),
                satellites,
            )
        )

    def attitude(self, attitude: Attitude, *, now_ns: int) -> bytes:
        """ATTITUDE; the rates are zero, because they are not known here."""
        return self.pack(common.MAVLink_attitude_message(_boot_ms(now_ns), *attitude, 0.0, 0.0, 0.0))

    def sys_status(
        self, battery: BatteryState | None, *, has_fix: bool = True, fenced: bool = False, beyond: bool = False
    ) -> bytes:
        """SYS_STATUS: the battery (None: unmeasured), and sensors, of which GPS alone may not be healthy."""
        gps, fence = common.MAV_SYS_STATUS_SENSOR_GPS, common.MAV_SYS_STATUS_GEOFENCE
        enabled = _HEALTHY | gps | (fence if fenced else 0)
        healthy = _HEALTHY | (gps if has_fix else 0) | (0 if beyond else fence)
        millivolts, centiamperes, _, percent = _battery_fields(battery)
        return self.pack(
            common.MAVLink_sys_status_message(
                _HEALTHY | gps | fence, enabled, healthy, 0, millivolts, centiamperes, percent, *(0,) * 6
            )
        )

    def battery_status(self, battery: BatteryState | None) -> bytes:
        """BATTERY_STATUS of the one battery, with its voltage in place of that of its first cell."""
        millivolts, centiamperes, consumed_mah, percent = _battery_fields(battery)
        return self.pack(
            common.MAVLink_battery_status_message(
                0,
                common.MAV_BATTERY_FUNCTION_ALL,
                common.MAV_BATTERY_TYPE_LIPO,
                _UNKNOWN_I16,
                [millivolts, *(_UNKNOWN_U16,) * 9],
                centiamperes,
                consumed_mah,
                -1,
                percent,
            )
        )

    def home_position(self, position: Enu) -> bytes:
        """HOME_POSITION: where the node started, on level ground facing north, to be approached from straight above."""
        ned = to_ned(position)
        level = (1.0, 0.0, 0.0, 0.0)
        lat, lon, alt_mm = _place_ints(to_geodetic(position, self._origin))
        return self.pack(common.MAVLink_home_position_message(lat, lon, alt_mm, *ned, level, 0.0, 0.0, 0.0))

    def extended_sys_state(self, landed: int = LANDED_IN_AIR) -> bytes:
        """EXTENDED_SYS_STATE of what is not a VTOL; `landed` is a MAV_LANDED_STATE, by default in the air."""
        return self.pack(common.MAVLink_extended_sys_state_message(common.MAV_VTOL_STATE_UNDEFINED, landed))

    def collision(self, other: NodeId, *, closest_s: float, altitude_m: float, horizontal_m: float) -> bytes:
        """COLLISION with node `id` (its system up to 250), avoided by height; distances are those in `closest_s`."""
        return self.pack(
            common.MAVLink_collision_message(
                common.MAV_COLLISION_SRC_MAVLINK_GPS_GLOBAL_INT,
                other,
                common.MAV_COLLISION_ACTION_ASCEND_OR_DESCEND,
                common.MAV_COLLISION_THREAT_LEVEL_HIGH,
                closest_s,
                altitude_m,
                horizontal_m,
            )
        )


def packed(message: object, node: NodeId) -> bytes:
    """A message of pymavlink as the frame of a node; raises LocalProtocolError for anything else."""
    pack = getattr(message, "pack", None)
    if pack is None:
        raise LocalProtocolError(f"content must be bytes or a message of pymavlink, not {type(message).__name__}")
    return bytes(pack(common.MAVLink(None, srcSystem=system_id(node), srcComponent=COMPONENT)))


def _boot_ms(now_ns: int) -> int:
    """MAVLink's 32 bits of milliseconds since boot, counted from the swarm's epoch; they wrap after 49 days."""
    return now_ns // MS & 0xFFFF_FFFF


# --- decoding -----------------------------------------------------------------------------------------------------


def decode(data: bytes, dialect: ModuleType | None = None) -> list[Any]:
    """Every message in some bytes; raises MalformedFrameError unless all frames are whole. `dialect`: decodes its own
    messages; one that none defines comes as UNKNOWN_<id>, its CRC unchecked. Signatures are not verified: pymavlink's
    check refuses the reordering that flooding has.
    """
    parser = common.MAVLink(None)
    errors: tuple[type[Exception], ...] = (common.MAVError, ValueError, TypeError)
    theirs: tuple[Any, Mapping[int, Any]] = (parser, {})
    if dialect is not None:
        try:
            theirs, errors = (dialect.MAVLink(None), dialect.mavlink_map), (*errors, dialect.MAVError)
        except (AttributeError, TypeError) as error:
            raise LocalProtocolError(f"dialect = {dialect!r} must be a module that pymavlink has generated") from error
    their_parser, their_ids = theirs
    try:
        return [
            (their_parser if int.from_bytes(frame[7:10], "little") in their_ids else parser).decode(bytearray(frame))
            for frame in frames(data)
        ]
    except errors as error:
        raise MalformedFrameError(f"not MAVLink: {error}") from error


def _only(packed: Packed, message_id: int) -> Any:  # noqa: ANN401  (pymavlink has no types)
    """The first inner frame of a packet that is this message, decoded; raises MalformedFrameError."""
    for found, inner in inner_frames(packed):
        if found == message_id:
            return decode(inner)[0]
    raise MalformedFrameError(f"no message {message_id} in the frame")


class Kinematics(NamedTuple):
    """The content of a GLOBAL_POSITION_INT, in the swarm's frame."""

    position: Enu
    velocity: Enu
    yaw: float | None
    """The heading [rad], clockwise from north."""
    t_ms: int


def kinematics(message: Any, origin: Geodetic = ORIGIN) -> Kinematics:  # noqa: ANN401  (pymavlink has no types)
    place = Geodetic(message.lat / 1e7, message.lon / 1e7, message.alt / 1000)
    velocity = from_ned(Ned(message.vx / 100, message.vy / 100, message.vz / 100))
    yaw = None if message.hdg == _UNKNOWN_U16 else math.radians(message.hdg / 100)
    return Kinematics(to_enu(place, origin), velocity, yaw, message.time_boot_ms)


def kinematics_of(packed: Packed, origin: Geodetic = ORIGIN) -> Kinematics:
    """What the GLOBAL_POSITION_INT in a packet says; raises MalformedFrameError."""
    return kinematics(_only(packed, common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT), origin)


@lru_cache(maxsize=8)
def kinematics_about(origin: Geodetic) -> Callable[[Packed], Kinematics]:
    """`kinematics_of` with this origin; always the same function, because what it returns is cached by it."""
    return partial(kinematics_of, origin=origin)


class Collision(NamedTuple):
    """The content of a COLLISION: with which node, when, and how far apart at that time."""

    other: int
    closest_s: float
    altitude_m: float
    horizontal_m: float


def collision_of(frame: bytes) -> Collision:
    """The COLLISION in a radio frame; raises MalformedFrameError, also for one that is not between nodes."""
    message = _only(frame, common.MAVLINK_MSG_ID_COLLISION)
    found = Collision(
        message.id, message.time_to_minimum_delta, message.altitude_minimum_delta, message.horizontal_minimum_delta
    )
    if (
        message.src != common.MAV_COLLISION_SRC_MAVLINK_GPS_GLOBAL_INT
        or not 0 < found.other <= MAX_NODES
        or not all(math.isfinite(value) and value >= 0 for value in found[1:])
    ):
        raise MalformedFrameError(f"collision from source {message.src}: {found}")
    return found
