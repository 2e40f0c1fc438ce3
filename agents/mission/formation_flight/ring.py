"""A place on a circle around another UAV, evenly spaced from the neighbors on it. Pure geometry.

    a UAV keeps its bearing from the middle, except that it turns towards the wider of the two gaps beside it

Nobody assigns places: each UAV turns by what it knows of its two neighbors on the circle, and the gaps become equal. A
UAV that joins divides a gap. When one is lost, its two neighbors turn into the gap. This is the balanced deployment on
a circle of Martinez and Bullo (Optimal sensor placement and motion coordination for target tracking, Automatica 42(4),
2006).
"""

import math
from collections.abc import Iterable
from typing import Final

from fanet_mw.units import GOLDEN_ANGLE, Enu

_WIDEST_RAD: Final = math.radians(80.0)
"""A wider gap counts as this one, because a UAV beyond it may be out of reach, so that its width is not known."""
_TURN: Final = 0.25
"""The turn, as a share of the difference of the two gaps; with a half the UAV would go to the middle at once, and
oscillate."""
_MOST_TURN_RAD: Final = math.radians(12.0)
_NO_BEARING_M: Final = 1.0


def place_on_ring(middle: Enu, here: Enu, others: Iterable[Enu], *, radius_m: float, node: int) -> Enu:
    """The place to fly to, at the height of `here`; `others` are those that fly around the same middle.

    `node` decides the direction of a UAV that is exactly in the middle.
    """
    bearing = _bearing(middle, here)
    if bearing is None:
        bearing = node * GOLDEN_ANGLE
    ahead = behind = _WIDEST_RAD
    for other in others:
        at = _bearing(middle, other)
        if at is None:
            continue
        off = (at - bearing) % (2 * math.pi)
        ahead, behind = min(ahead, off), min(behind, 2 * math.pi - off)
    turn = max(-_MOST_TURN_RAD, min(_MOST_TURN_RAD, _TURN * (ahead - behind)))
    angle = bearing + turn
    return Enu(middle.east + radius_m * math.sin(angle), middle.north + radius_m * math.cos(angle), here.up)


def _bearing(middle: Enu, place: Enu) -> float | None:
    """The bearing, clockwise from north; None exactly in the middle."""
    east, north = place.east - middle.east, place.north - middle.north
    return None if math.hypot(east, north) < _NO_BEARING_M else math.atan2(east, north)
