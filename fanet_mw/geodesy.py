"""Places on earth, and the plane that touches the WGS84 ellipsoid at an origin, in which a swarm's positions are.

Conversions use the earth-centered frame and are exact. Not modeled: geoid height, so altitudes are over the ellipsoid.
"""

import math
from functools import lru_cache
from typing import Final, NamedTuple

from fanet_mw.errors import LocalProtocolError
from fanet_mw.units import DEFAULT_ORIGIN_DEG, Enu

_A: Final = 6_378_137.0
"""WGS84 semi-major axis [m]."""
_E2: Final = 6.694_379_990_14e-3
"""WGS84 first eccentricity squared."""
_B: Final = _A * math.sqrt(1 - _E2)
_EP2: Final = _E2 / (1 - _E2)
"""Second eccentricity squared."""


class Geodetic(NamedTuple):
    """WGS84 latitude and longitude [degrees], height over the ellipsoid [m]."""

    lat_deg: float
    lon_deg: float
    alt_m: float


ORIGIN: Final = Geodetic(*DEFAULT_ORIGIN_DEG, 0.0)
"""Where the swarm's frame touches the earth unless scenario or map name another point (`world.origin_deg`)."""


class _Plane(NamedTuple):
    """An origin in the earth-centered frame, with sines and cosines that turn vectors into east, north, up."""

    x: float
    y: float
    z: float
    sin_lat: float
    cos_lat: float
    sin_lon: float
    cos_lon: float


def _earth_centered(place: Geodetic) -> _Plane:
    lat, lon = math.radians(place.lat_deg), math.radians(place.lon_deg)
    sin_lat, cos_lat, sin_lon, cos_lon = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    normal = _A / math.sqrt(1 - _E2 * sin_lat * sin_lat)
    across = (normal + place.alt_m) * cos_lat
    z = (normal * (1 - _E2) + place.alt_m) * sin_lat
    return _Plane(across * cos_lon, across * sin_lon, z, sin_lat, cos_lat, sin_lon, cos_lon)


@lru_cache(maxsize=8)
def _plane(origin: Geodetic) -> _Plane:
    if not (abs(origin.lat_deg) <= 90 and abs(origin.lon_deg) <= 180 and math.isfinite(origin.alt_m)):
        raise LocalProtocolError(f"origin = {origin} must be within 90 and 180 degrees, and its height finite")
    return _earth_centered(origin)


def to_geodetic(position: Enu, origin: Geodetic = ORIGIN) -> Geodetic:
    """The place on earth of a point in the swarm's frame."""
    o = _plane(origin)
    outward = o.cos_lat * position.up - o.sin_lat * position.north
    x = o.x + o.cos_lon * outward - o.sin_lon * position.east
    y = o.y + o.sin_lon * outward + o.cos_lon * position.east
    z = o.z + o.cos_lat * position.north + o.sin_lat * position.up
    across = math.hypot(x, y)
    theta = math.atan2(z * _A, across * _B)  # Bowring (1976): one step is exact to a micrometre near the ground
    lat = math.atan2(z + _EP2 * _B * math.sin(theta) ** 3, across - _E2 * _A * math.cos(theta) ** 3)
    sin_lat = math.sin(lat)
    alt_m = across * math.cos(lat) + z * sin_lat - _A * math.sqrt(1 - _E2 * sin_lat * sin_lat)
    return Geodetic(math.degrees(lat), math.degrees(math.atan2(y, x)), alt_m)


def to_enu(place: Geodetic, origin: Geodetic = ORIGIN) -> Enu:
    """The inverse of `to_geodetic`."""
    o, p = _plane(origin), _earth_centered(place)
    dx, dy, dz = p.x - o.x, p.y - o.y, p.z - o.z
    outward = o.cos_lon * dx + o.sin_lon * dy
    return Enu(
        o.cos_lon * dy - o.sin_lon * dx,
        o.cos_lat * dz - o.sin_lat * outward,
        o.cos_lat * outward + o.sin_lat * dz,
    )
