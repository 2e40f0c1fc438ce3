"""The byte format of sensor readings: one encoder and one decoder for each kind.

Bytes that are no reading raise ValueError or struct.error, which `codecs.py` turns into MalformedFrameError.
"""

import math
import struct
from collections.abc import Iterable, Sequence
from typing import Any, Final

from fanet_mw.bus.messages import (
    Altimeter,
    Battery,
    Call,
    Camera,
    CameraImage,
    Echo,
    FlightState,
    Gps,
    Inertial,
    Person,
    Radar,
    Voice,
    WifiScan,
    WindEstimate,
)
from fanet_mw.units import Enu

_GPS = struct.Struct("<q6d")
_SCAN = struct.Struct("<qH")
_HEARD = struct.Struct("<If")
_PERSON = struct.Struct("<3d")
_IMAGE = struct.Struct("<qHH")
_CALL = struct.Struct("<4d")
_ECHO = struct.Struct("<5d")
_ALTIMETER = struct.Struct("<q2d")
_INERTIAL = struct.Struct("<q3d")
_BATTERY = struct.Struct("<q3d")
_FLIGHT = struct.Struct("<q3dBdq")
MAX_HEARD: Final = 10_000
"""The greatest number of phones in a scan, people in an image, or voices: the most survivors that a
scenario may have."""
MAX_ECHOES: Final = 4_096
"""The greatest number of returns in a radar scan."""


def encode_gps(m: Gps) -> bytes:
    return _GPS.pack(m.t_ns, *m.position, *m.velocity)


def decode_gps(body: bytes) -> Gps:
    t_ns, *values = _GPS.unpack(body)
    return Gps(t_ns, Enu(*values[:3]), Enu(*values[3:]))


def encode_scan(m: WifiScan) -> bytes:
    return _SCAN.pack(m.t_ns, len(m.heard)) + b"".join(_HEARD.pack(*item) for item in m.heard)


def decode_scan(body: bytes) -> WifiScan:
    t_ns, count = _SCAN.unpack_from(body)
    rest = body[_SCAN.size :]
    if len(rest) != count * _HEARD.size or count > MAX_HEARD:
        raise ValueError("length")
    return WifiScan(t_ns, tuple((survivor, rssi) for survivor, rssi in _HEARD.iter_unpack(rest)))


def _finite(values: Iterable[float]) -> None:
    """Raise ValueError for values that no sensor can give: infinite ones and NaN."""
    if not all(map(math.isfinite, values)):
        raise ValueError("not finite")


def _encode_rows(t_ns: int, rows: Sequence[tuple[float, ...]], row: struct.Struct) -> bytes:
    return _SCAN.pack(t_ns, len(rows)) + b"".join(row.pack(*item) for item in rows)


def _decode_rows(body: bytes, row: struct.Struct, *, most: int) -> tuple[int, list[tuple[float, ...]]]:
    """The instant of a reading, and its rows of finite numbers, as many as the count in front of them says."""
    t_ns, count = _SCAN.unpack_from(body)
    if len(body) != _SCAN.size + count * row.size or count > most:
        raise ValueError("length")
    rows = list(row.iter_unpack(body[_SCAN.size :]))
    for item in rows:
        _finite(item)
    return t_ns, rows


def encode_camera(m: Camera) -> bytes:
    return _encode_rows(m.t_ns, m.people, _PERSON)


def decode_camera(body: bytes) -> Camera:
    t_ns, rows = _decode_rows(body, _PERSON, most=MAX_HEARD)
    return Camera(t_ns, tuple(Person(*row) for row in rows))


def encode_image(m: CameraImage) -> bytes:
    return _IMAGE.pack(m.t_ns, m.width, m.height) + m.rgb


def decode_image(body: bytes) -> CameraImage:
    t_ns, width, height = _IMAGE.unpack_from(body)
    rgb = body[_IMAGE.size :]
    if len(rgb) != 3 * width * height:
        raise ValueError("length")
    return CameraImage(t_ns, width, height, rgb)


def encode_voice(m: Voice) -> bytes:
    return _encode_rows(m.t_ns, m.calls, _CALL)


def decode_voice(body: bytes) -> Voice:
    t_ns, rows = _decode_rows(body, _CALL, most=MAX_HEARD)
    return Voice(t_ns, tuple(Call(*row) for row in rows))


def encode_radar(m: Radar) -> bytes:
    return _encode_rows(m.t_ns, m.echoes, _ECHO)


def decode_radar(body: bytes) -> Radar:
    t_ns, rows = _decode_rows(body, _ECHO, most=MAX_ECHOES)
    return Radar(t_ns, tuple(Echo(*row) for row in rows))


def encode_altimeter(m: Altimeter) -> bytes:
    return _ALTIMETER.pack(m.t_ns, m.up_m, math.nan if m.above_ground_m is None else m.above_ground_m)


def decode_altimeter(body: bytes) -> Altimeter:
    t_ns, up_m, above_ground_m = _ALTIMETER.unpack(body)
    nothing = math.isnan(above_ground_m)
    _finite((up_m,) if nothing else (up_m, above_ground_m))
    return Altimeter(t_ns, up_m, None if nothing else above_ground_m)


def encode_inertial(m: Inertial) -> bytes:
    return _INERTIAL.pack(m.t_ns, *m.velocity)


def decode_inertial(body: bytes) -> Inertial:
    t_ns, *velocity = _INERTIAL.unpack(body)
    _finite(velocity)
    return Inertial(t_ns, Enu(*velocity))


def encode_battery(m: Battery) -> bytes:
    return _BATTERY.pack(m.t_ns, m.voltage_v, m.current_a, m.charge)


def decode_battery(body: bytes) -> Battery:
    t_ns, *values = _BATTERY.unpack(body)
    _finite(values)
    return Battery(t_ns, *values)


def encode_flight(m: FlightState) -> bytes:
    hdop = math.nan if m.hdop is None else m.hdop
    return _FLIGHT.pack(m.t_ns, m.roll_rad, m.pitch_rad, m.yaw_rad, m.satellites, hdop, m.unix_ns)


def decode_flight(body: bytes) -> FlightState:
    t_ns, roll_rad, pitch_rad, yaw_rad, satellites, hdop, unix_ns = _FLIGHT.unpack(body)
    if unix_ns < 0:
        raise ValueError("time")
    unknown = math.isnan(hdop)
    _finite((roll_rad, pitch_rad, yaw_rad, *(() if unknown else (hdop,))))
    return FlightState(t_ns, roll_rad, pitch_rad, yaw_rad, satellites, None if unknown else hdop, unix_ns)


def encode_wind(m: WindEstimate) -> bytes:
    return _INERTIAL.pack(m.t_ns, *m.velocity)


def decode_wind(body: bytes) -> WindEstimate:
    return WindEstimate(*decode_inertial(body))


HEADS: Final[dict[type[Any], tuple[struct.Struct, ...]]] = {
    Gps: (_GPS,), WifiScan: (_SCAN, _HEARD), Camera: (_SCAN, _PERSON), Voice: (_SCAN, _CALL), Radar: (_SCAN, _ECHO),
    Altimeter: (_ALTIMETER,), Inertial: (_INERTIAL,), Battery: (_BATTERY,), CameraImage: (_IMAGE,),
    FlightState: (_FLIGHT,),
    WindEstimate: (_INERTIAL,),
}  # fmt: skip
"""The structs of each kind of reading, as in `codecs.HEADS`."""
