"""What an operator uploads: missions, fences and rally points, checked and in the swarm's frame.

An item is refused with MAVLink's own reason as soon as it arrives; nothing of a refused upload is kept.
"""

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import Any, Final, NamedTuple

from fanet_mw.mavlink import Geodetic, common, to_enu
from fanet_mw.units import Enu

MOST_ITEMS: Final = 500
"""The longest mission, fence or list of rally points; PX4 has 500 waypoints on small flight controllers."""


class Kind(IntEnum):
    """What a plan is; the values are MAV_MISSION_TYPE."""

    MISSION = common.MAV_MISSION_TYPE_MISSION
    FENCE = common.MAV_MISSION_TYPE_FENCE
    RALLY = common.MAV_MISSION_TYPE_RALLY


class Item(NamedTuple):
    """One item as it was uploaded, and is downloaded again."""

    frame: int
    command: int
    autocontinue: int
    params: tuple[float, float, float, float]
    x: int
    """Latitude [degrees x 1e7]; of a command without a place, its fifth parameter."""
    y: int
    z: float


class RefusedError(ValueError):
    """An item that cannot be flown; `result` is a MAV_MISSION_RESULT."""

    def __init__(self, result: int) -> None:
        super().__init__(result)
        self.result = result


_GLOBAL: Final = (common.MAV_FRAME_GLOBAL, common.MAV_FRAME_GLOBAL_INT)
_RELATIVE: Final = (common.MAV_FRAME_GLOBAL_RELATIVE_ALT, common.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
_PLACES: Final = frozenset({
    common.MAV_CMD_NAV_WAYPOINT, common.MAV_CMD_NAV_LOITER_TIME, common.MAV_CMD_NAV_LOITER_UNLIM,
    common.MAV_CMD_NAV_TAKEOFF, common.MAV_CMD_NAV_LAND,
})  # fmt: skip
_OTHERS: Final = frozenset({
    common.MAV_CMD_NAV_RETURN_TO_LAUNCH, common.MAV_CMD_NAV_DELAY, common.MAV_CMD_DO_CHANGE_SPEED,
    common.MAV_CMD_DO_JUMP, common.MAV_CMD_CONDITION_DELAY,
})  # fmt: skip
_IN_POLYGON: Final = common.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
_OUT_OF_POLYGON: Final = common.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
_IN_CIRCLE: Final = common.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
_OUT_OF_CIRCLE: Final = common.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
LEVEL_SPEEDS: Final = (common.SPEED_TYPE_AIRSPEED, common.SPEED_TYPE_GROUNDSPEED)
"""The kinds of speed that DO_CHANGE_SPEED may change here; no UAV climbs or sinks at a speed of its own."""
USUAL_SPEED: Final = -2
"""In place of a speed: that of the parameter again."""
_FENCES: Final = frozenset({_IN_POLYGON, _OUT_OF_POLYGON, _IN_CIRCLE, _OUT_OF_CIRCLE})


def item_of(message: Any) -> Item:  # noqa: ANN401  (pymavlink has no types)
    """The content of a MISSION_ITEM_INT, or of the older MISSION_ITEM, whose degrees are floats."""
    x, y = message.x, message.y
    if message.get_type() == "MISSION_ITEM":
        scale = 1 if message.frame == common.MAV_FRAME_MISSION else 1e7
        if not abs(x * scale) < 2**31:
            raise RefusedError(common.MAV_MISSION_INVALID_PARAM5_X)
        if not abs(y * scale) < 2**31:
            raise RefusedError(common.MAV_MISSION_INVALID_PARAM6_Y)
        x, y = round(x * scale), round(y * scale)
    params = (message.param1, message.param2, message.param3, message.param4)
    return Item(message.frame, message.command, message.autocontinue, params, x, y, message.z)


_MOST_LAT: Final = 900_000_000
_MOST_LON: Final = 1_800_000_000


class Ground(NamedTuple):
    """How places of messages become places of the swarm's frame."""

    origin: Geodetic
    home_m: float

    def height(self, frame: int, z: float) -> float | None:
        """A height over the origin; None for a frame that is not known here."""
        if frame in _RELATIVE:
            return self.home_m + z
        return z - self.origin.alt_m if frame in _GLOBAL else None

    def place(self, frame: int, x: int, y: int, z: float) -> Enu | None:
        """A place in the swarm's frame; its height over the ground plane is kept, not that over a round earth."""
        up_m = self.height(frame, z)
        if up_m is None or abs(x) > _MOST_LAT or abs(y) > _MOST_LON or not math.isfinite(up_m):
            return None
        flat = to_enu(Geodetic(x / 1e7, y / 1e7, self.origin.alt_m), self.origin)
        return Enu(flat.east, flat.north, up_m)


def _place_of(item: Item, ground: Ground) -> Enu:
    """The place of an item; raises RefusedError with the parameter that is wrong."""
    if ground.height(item.frame, item.z) is None:
        raise RefusedError(common.MAV_MISSION_UNSUPPORTED_FRAME)
    if abs(item.x) > _MOST_LAT:
        raise RefusedError(common.MAV_MISSION_INVALID_PARAM5_X)
    if abs(item.y) > _MOST_LON:
        raise RefusedError(common.MAV_MISSION_INVALID_PARAM6_Y)
    place = ground.place(item.frame, item.x, item.y, item.z)
    if place is None:
        raise RefusedError(common.MAV_MISSION_INVALID_PARAM7)
    return place


class Step(NamedTuple):
    """One item of a mission, to be flown."""

    command: int
    place: Enu | None
    """Where to; None for a command without a place, or for a landing or take-off where the UAV is."""
    params: tuple[float, float, float, float]


def step_of(item: Item, ground: Ground) -> Step:
    """What a mission's item asks for; raises RefusedError."""
    if item.command == common.MAV_CMD_DO_JUMP and not math.isfinite(item.params[0]):
        raise RefusedError(common.MAV_MISSION_INVALID_PARAM1)
    if item.command == common.MAV_CMD_DO_CHANGE_SPEED and item.params[0] not in LEVEL_SPEEDS:
        raise RefusedError(common.MAV_MISSION_INVALID_PARAM1)
    if item.command in _OTHERS:
        return Step(item.command, None, item.params)
    if item.command not in _PLACES:
        raise RefusedError(common.MAV_MISSION_UNSUPPORTED)
    place = _place_of(item, ground)
    here = not item.x and not item.y and item.command in (common.MAV_CMD_NAV_LAND, common.MAV_CMD_NAV_TAKEOFF)
    return Step(item.command, place._replace(east=math.nan, north=math.nan) if here else place, item.params)


class Area(NamedTuple):
    """A polygon or a circle that the UAV must not leave, or must not enter."""

    inside: bool
    corners: tuple[tuple[float, float], ...]
    """East and north of each corner; of a circle its center alone."""
    radius_m: float = 0.0

    def allows(self, east: float, north: float) -> bool:
        if len(self.corners) == 1:
            center = self.corners[0]
            return (math.hypot(east - center[0], north - center[1]) <= self.radius_m) is self.inside
        return _holds(self.corners, east, north) is self.inside


def _holds(corners: Sequence[tuple[float, float]], east: float, north: float) -> bool:
    """True if a place is inside a polygon (crossings of a ray to the east)."""
    inside = False
    for (e1, n1), (e2, n2) in zip(corners, (*corners[1:], corners[0]), strict=True):
        if (n1 > north) is not (n2 > north) and east < e1 + (north - n1) / (n2 - n1) * (e2 - e1):
            inside = not inside
    return inside


def fence_of(items: Sequence[Item], ground: Ground) -> tuple[Area, ...]:
    """The areas of an uploaded fence; raises RefusedError."""
    areas, at = [], 0
    while at < len(items):
        item = items[at]
        if item.command not in _FENCES:
            raise RefusedError(common.MAV_MISSION_UNSUPPORTED)
        circle = item.command in (_IN_CIRCLE, _OUT_OF_CIRCLE)
        count = 1 if circle else round(item.params[0]) if 3 <= item.params[0] <= len(items) - at else 0
        if not count or (circle and not 0 < item.params[0] < math.inf):
            raise RefusedError(common.MAV_MISSION_INVALID_PARAM1)
        corners = []
        for vertex in items[at : at + count]:
            if vertex.command != item.command:
                raise RefusedError(common.MAV_MISSION_INVALID_SEQUENCE)
            place = _place_of(vertex._replace(frame=common.MAV_FRAME_GLOBAL, z=0.0), ground)
            corners.append((place.east, place.north))
        radius_m = item.params[0] if circle else 0.0
        areas.append(Area(item.command in (_IN_CIRCLE, _IN_POLYGON), tuple(corners), radius_m))
        at += count
    return tuple(areas)


def rally_of(items: Sequence[Item], ground: Ground) -> tuple[Enu, ...]:
    """The places to which a UAV may return; raises RefusedError."""
    places = []
    for item in items:
        if item.command != common.MAV_CMD_NAV_RALLY_POINT:
            raise RefusedError(common.MAV_MISSION_UNSUPPORTED)
        places.append(_place_of(item, ground))
    return tuple(places)


def allowed(areas: Sequence[Area], place: Enu) -> bool:
    """True if no area of a fence objects to a place."""
    return all(area.allows(place.east, place.north) for area in areas)
