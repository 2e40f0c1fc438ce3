"""The formation `circuit`: one closed way over the whole area, on which all UAVs fly at equal distances.

    +---------------+     lanes up and down between the far side and a strip along the near side; the way back along
    | +-+  +-+  +-+ |     that strip closes the circuit, and searches the strip
    | | |  | |  | | |
    | | +--+ +--+ | |     n UAVs have searched all of it when each has flown the n-th part of it, whatever n is; in the
    | +-----------+ |     next sweep each flies over what the one ahead has searched, and so on: nobody turns back
    +---------------+

No two UAVs need be within radio reach of each other. All are one team (`contract.py`).
"""

import math
from bisect import bisect_right
from itertools import accumulate, pairwise
from typing import Final

from agents.mission.search_formation.shapes.contract import Demands, Dimensions, RowKind, RowOfPlaces, Shape, ShapeName
from fanet_mw.units import Enu

_LEAST_LANES: Final = 2


class Circuit(Shape):
    """The positions of the places on one circuit."""

    def __init__(self, formation: Dimensions) -> None:
        self._formation = formation
        half, side = formation.half_width_m, 2 * formation.first_m
        corners = _corners(half, side)
        self._corners = corners
        self._until_m = (0.0, *accumulate(math.dist(a, b) for a, b in pairwise(corners)))
        """How far along the way each corner is; the last one is the first one again."""

    @property
    def sweep_s(self) -> float:
        return self._until_m[-1] / (self._formation.lanes * self._formation.speed_m_s)

    @property
    def lane_m(self) -> float:
        return 2 * self._formation.first_m

    def at(self, place: float, swept_s: float) -> Enu:
        formation, whole_m = self._formation, self._until_m[-1]
        along_m = (place * whole_m / formation.lanes + max(0.0, swept_s) * formation.speed_m_s) % whole_m
        corner = min(bisect_right(self._until_m, along_m), len(self._until_m) - 1)
        (east, north), (to_east, to_north) = self._corners[corner - 1], self._corners[corner]
        share = (along_m - self._until_m[corner - 1]) / (self._until_m[corner] - self._until_m[corner - 1])
        return Enu(east + share * (to_east - east), north + share * (to_north - north), formation.height_m)

    def tethers(self, place: int) -> tuple[int, ...]:
        return ()

    def rows(self) -> tuple[RowOfPlaces, ...]:
        return (RowOfPlaces(0, self._formation.lanes, RowKind.AROUND),)


def _corners(half_m: float, lane_m: float) -> list[tuple[float, float]]:
    """The corners of the circuit in a square, from the southwestern one and back to it; an even number of lanes."""
    lanes = round(2 * half_m / lane_m)
    far, back = half_m - lane_m / 2, -half_m + lane_m / 2
    near = back + lane_m
    corners = [(-half_m + lane_m / 2, back)]
    for lane in range(lanes):
        east, ends = -half_m + (lane + 0.5) * lane_m, (near, far)
        corners += [(east, end) for end in (ends if lane % 2 == 0 else ends[::-1])]
    corners[1] = (corners[1][0], far)  # the first and the last lane reach down to the way back
    corners[-1] = (corners[-1][0], back)
    del corners[2]
    return [*corners, corners[0]]


def fitted(count: int, demands: Demands) -> Dimensions:
    half = demands.area_m / 2
    lanes = max(_LEAST_LANES, 2 * math.ceil(demands.area_m / demands.apart_m(math.inf) / 2))
    return Dimensions(
        count, 0, 0, half, half / lanes, max(half, half / lanes + 1.0), demands.height_m, demands.speed_m_s,
        ShapeName.CIRCUIT, 1,
    )  # fmt: skip
