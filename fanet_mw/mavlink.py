"""Native MAVLink messages, and the only place that knows NED and geodetic coordinates. The border to pymavlink.

Inside, positions are ENU metres of the swarm's frame, a tangent plane at `ORIGIN`. Outside, GLOBAL_POSITION_INT has
WGS84 degrees x 1e7 and velocities north, east, down in cm/s. `mavutil` is not imported: it loads every dialect.
"""

import math
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import common

from fanet_mw.dialect import fanet
from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import MS, Enu, NodeId
from fanet_mw.wire import COMPONENT, system_id

common.mavlink_map.update(fanet.mavlink_map)  # one parser for both dialects

_A: Final = 6_378_137.0
"""WGS84 semi-major axis [m]."""
_E2: Final = 6.694_379_990_14e-3
"""WGS84 first eccentricity squared."""


class Geodetic(NamedTuple):
    """WGS84 latitude and longitude [degrees], altitude above the origin's [m]."""

    lat_deg: float
    lon_deg: float
    alt_m: float


ORIGIN: Final = Geodetic(37.5665, 126.978, 0.0)
"""Where the swarm's frame touches the earth unless told otherwise."""


def _radii(lat_deg: float) -> tuple[float, float]:
    """Meridian radius and radius of the parallel [m] at a latitude."""
    sine = math.sin(math.radians(lat_deg))
    w = math.sqrt(1 - _E2 * sine * sine)
    return _A * (1 - _E2) / w**3, _A / w * math.cos(math.radians(lat_deg))


def to_geodetic(position: Enu, origin: Geodetic = ORIGIN) -> Geodetic:
    """Tangent-plane approximation: exact to a centimetre in round trips, to metres in truth within 10 km."""
    meridian, parallel = _radii(origin.lat_deg)
    return Geodetic(
        origin.lat_deg + math.degrees(position.north / meridian),
        origin.lon_deg + math.degrees(position.east / parallel),
        origin.alt_m + position.up,
    )


def to_enu(place: Geodetic, origin: Geodetic = ORIGIN) -> Enu:
    """The inverse of `to_geodetic`."""
    meridian, parallel = _radii(origin.lat_deg)
    return Enu(
        math.radians(place.lon_deg - origin.lon_deg) * parallel,
        math.radians(place.lat_deg - origin.lat_deg) * meridian,
        place.alt_m - origin.alt_m,
    )


class Encoder:
    """Native messages of one node, as MAVLink 2 frames with its own sequence."""

    def __init__(self, node: NodeId) -> None:
        self._mav = common.MAVLink(None, srcSystem=system_id(node), srcComponent=COMPONENT)

    def _pack(self, message: Any) -> bytes:  # noqa: ANN401  (pymavlink has no types)
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return data

    def heartbeat(self) -> bytes:
        return self._pack(
            common.MAVLink_heartbeat_message(
                common.MAV_TYPE_QUADROTOR,
                common.MAV_AUTOPILOT_INVALID,
                common.MAV_MODE_FLAG_SAFETY_ARMED | common.MAV_MODE_FLAG_AUTO_ENABLED,
                0,
                common.MAV_STATE_ACTIVE,
                3,
            )
        )

    def global_position(self, position: Enu, velocity: Enu, *, now_ns: int, origin: Geodetic = ORIGIN) -> bytes:
        place = to_geodetic(position, origin)
        heading = math.degrees(math.atan2(velocity.east, velocity.north)) % 360
        return self._pack(
            common.MAVLink_global_position_int_message(
                now_ns // MS & 0xFFFF_FFFF,
                round(place.lat_deg * 1e7),
                round(place.lon_deg * 1e7),
                round(place.alt_m * 1000),
                round(position.up * 1000),
                _int16(velocity.north * 100),
                _int16(velocity.east * 100),
                _int16(-velocity.up * 100),
                round(heading * 100) % 36000,
            )
        )

    def attitude(self, *, roll: float, pitch: float, yaw: float, now_ns: int) -> bytes:
        """Angles in radians, rates left at zero."""
        return self._pack(common.MAVLink_attitude_message(now_ns // MS & 0xFFFF_FFFF, roll, pitch, yaw, 0.0, 0.0, 0.0))

    def sys_status(self, *, battery_percent: int, load: float) -> bytes:
        """`load` is the share of the link's drops in [0, 1]."""
        voltage_mv = 14_000 + 28 * battery_percent
        return self._pack(
            common.MAVLink_sys_status_message(
                0, 0, 0, 0, voltage_mv, -1, battery_percent, round(1e4 * load), 0, 0, 0, 0, 0
            )
        )


def _int16(value: float) -> int:
    return max(-32768, min(32767, round(value)))


def decode(data: bytes) -> list[Any]:
    """Every message in some bytes, native or ours; raises MalformedFrameError when they are not whole frames."""
    parser = common.MAVLink(None)
    parser.robust_parsing = False
    try:
        messages = parser.parse_buffer(bytearray(data)) or []
    except (common.MAVError, ValueError, IndexError) as error:
        raise MalformedFrameError(f"not MAVLink: {error}") from error
    if parser.buf_len() > 0:
        raise MalformedFrameError(f"{parser.buf_len()} bytes left over")
    return list(messages)
