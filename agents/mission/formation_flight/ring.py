"""A place on a circle around another UAV, evenly spaced from the neighbors on it
(docs/explanation/formation-flight.md). Pure geometry.

Nobody assigns places (balanced deployment on a circle: Martinez and Bullo, Optimal sensor placement and motion
coordination for target tracking, Automatica 42(4), 2006).
"""

import math
from collections.abc import Iterable
from typing import Final

from fanet_mw.units import GOLDEN_ANGLE, Enu

_WIDEST_RAD: Final = math.radians(74.0)
"""A wider gap counts as this one, so that the few UAVs of a small circle stay together: at 200 m from the middle the
two beside such a gap hear each other at 241 m, and need no head between them. Who is beyond a wider one is not heard,
so that its width is not known."""
_TURN: Final = 0.25
"""The turn, as a share of the difference of the two gaps; with a half the UAV would oscillate."""
_MOST_TURN_RAD: Final = math.radians(12.0)
_NO_BEARING_M: Final = 1.0


def place_on_ring(
    middle: Enu, here: Enu, others: Iterable[Enu], *, radius_m: float, node: int, faces: Iterable[Enu] = ()
) -> Enu:
    """The place to fly to at the height of `here`; `faces`: the middles of the circles to be joined."""
    bearing = _bearing(middle, here)
    if bearing is None:
        bearing = node * GOLDEN_ANGLE
    around = [at for other in others if (at := _bearing(middle, other)) is not None]
    turn = _turn_to_face(bearing, around, [at for face in faces if (at := _bearing(middle, face)) is not None])
    if turn is None:
        gaps = [(at - bearing) % (2 * math.pi) for at in around]
        ahead, behind = min([_WIDEST_RAD, *gaps]), min([_WIDEST_RAD, *(2 * math.pi - gap for gap in gaps)])
        turn = _TURN * (ahead - behind)
    angle = bearing + max(-_MOST_TURN_RAD, min(_MOST_TURN_RAD, turn))
    return Enu(middle.east + radius_m * math.sin(angle), middle.north + radius_m * math.cos(angle), here.up)


def _turn_to_face(bearing: float, others: Iterable[float], faces: Iterable[float]) -> float | None:
    """The turn to the nearest of those bearings to which no other UAV of the circle is as near; or None."""
    turns = [
        _signed(face - bearing)
        for face in faces
        if all(abs(_signed(face - bearing)) < abs(_signed(face - other)) for other in others)
    ]
    return min(turns, key=abs, default=None)


def _signed(angle: float) -> float:
    """The angle between -pi and pi."""
    return math.remainder(angle, 2 * math.pi)


def _bearing(middle: Enu, place: Enu) -> float | None:
    east, north = place.east - middle.east, place.north - middle.north
    return None if math.hypot(east, north) < _NO_BEARING_M else math.atan2(east, north)
