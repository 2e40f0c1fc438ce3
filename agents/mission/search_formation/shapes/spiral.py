"""The formation `spiral`: arms of UAVs that turn about the middle of the area, each lane on a square of its own.

    +-----------------+     lane k of an arm flies on the square of half-side (2 k + 1) x `first_m`; all lanes of an arm
    | +-------------+ |     are on one ray from the middle, so the distance of two neighboring lanes is at least
    | | +---------+ | |     2 x `first_m`, and at most the root of 2 times that
    | | |    o-o-o-o-o
    | | +---------+ | |     full arms reach from near the middle to the edge of the area: if there are several, each
    | +-------------+ |     sweeps its share of a turn, and their innermost lanes stay within reach of each other
    +-----------------+

UAVs that are too few for one full arm form a shorter one, which winds outward: the expanding square search of IAMSAR,
volume II, flown by several UAVs abreast. It turns around the middle first, flies the last turn along the edge, and
returns on the same way. The teams are the arms (`contract.py`); the outermost lane flies at the speed of the sweep, or
a little slower while winding.
"""

import math
from typing import Final

from agents.mission.search_formation.shapes.contract import FOLLOWER_HIGHER_M, Demands, Dimensions, Shape, ShapeName
from fanet_mw.units import Enu

_BEHIND_S: Final = 15.0
"""A follower flies where its arm was this time before."""
_ARMS_M: Final = 60.0
"""The least distance between the innermost lanes of two arms, measured along the square on which they fly."""


class Spiral(Shape):
    """The positions of the places of one spiral."""

    def __init__(self, formation: Dimensions) -> None:
        self._formation = formation
        lanes, first_m = formation.lanes, formation.first_m
        self._outer_m = first_m * (2 * lanes - 1)
        """The half-side of the square of the outermost lane during the first turn."""
        self._pitch_m = 2 * first_m * lanes
        """A winding arm increases the half-side of each lane's square by this much in each turn."""
        rounds = (formation.last_m / first_m + 1) / (2 * lanes)
        self._winds = max(0, round(rounds) - 1)
        """The number of turns that wind outward, 0 for full arms. A winding arm flies one turn before them and one
        after them on squares of constant size."""

    @property
    def lane_m(self) -> float:
        return 2 * self._formation.first_m

    @property
    def sweep_s(self) -> float:
        if not self._winds:
            return 8 * self._outer_m / (self._formation.teams * self._formation.speed_m_s)
        return self._way_m(self._winds + 2) / self._formation.speed_m_s

    def at(self, place: float, swept_s: float) -> Enu:
        formation = self._formation
        swept_s = max(0.0, swept_s)
        if place < formation.fixed:
            team, lane = divmod(place, formation.lanes)
            return self._at(int(team), lane, swept_s, formation.height_m)
        team, share = formation.follower(round(place))
        higher_m = formation.height_m + FOLLOWER_HIGHER_M
        return self._at(team, share * formation.lanes - 0.5, max(0.0, swept_s - _BEHIND_S), higher_m)

    def tethers(self, place: int) -> tuple[int, ...]:
        formation = self._formation
        if place >= formation.fixed:
            return ()
        team, lane = divmod(place, formation.lanes)
        found = [place - 1] if lane > 0 else []
        found += [place + 1] if lane < formation.lanes - 1 else []
        if lane == 0 and formation.teams > 1:
            around = {(team - 1) % formation.teams, (team + 1) % formation.teams}
            found += sorted(other * formation.lanes for other in around)
        return tuple(found)

    def _at(self, team: int, lane: float, swept_s: float, up_m: float) -> Enu:
        turned = self._turned(swept_s)
        half_m = self._formation.first_m * (2 * lane + 1) + self._pitch_m * self._wound(turned)
        east, north = _on_square(turned + team / self._formation.teams)
        return Enu(half_m * east, half_m * north, up_m)

    def _wound(self, turned: float) -> float:
        return min(max(0.0, turned - 1), self._winds)

    def _way_m(self, turned: float) -> float:
        """An upper bound of the outermost lane's way after some turns; exact while squares have a constant size."""
        wound = self._wound(turned)
        level = turned - wound
        first = min(level, 1.0)
        outward = wound * (8 * self._outer_m + math.sqrt(2) * self._pitch_m) + 4 * self._pitch_m * wound * wound
        return 8 * self._outer_m * first + outward + 8 * (self._outer_m + self._pitch_m * wound) * (level - first)

    def _turned(self, swept_s: float) -> float:
        """Turns flown after this time; of a winding arm they grow to its end, fall to 0 on the way back, and so on."""
        way_m = swept_s * self._formation.speed_m_s
        if not self._winds:
            return way_m / (8 * self._outer_m)
        whole_m = self._way_m(self._winds + 2)
        way_m = math.fmod(way_m, 2 * whole_m)
        way_m = min(way_m, 2 * whole_m - way_m)
        first_m, outward_m = 8 * self._outer_m, self._way_m(self._winds + 1)
        if way_m <= first_m:
            return way_m / first_m
        if way_m >= outward_m:
            return self._winds + 1 + (way_m - outward_m) / (8 * (self._outer_m + self._pitch_m * self._winds))
        # w turns of winding outward take 4 pitch w^2 + (8 outer + sqrt(2) pitch) w = way_m - first_m (`_way_m`)
        square, linear, rest = 4 * self._pitch_m, first_m + math.sqrt(2) * self._pitch_m, way_m - first_m
        return 1 + 2 * rest / (linear + math.sqrt(linear * linear + 4 * square * rest))


def _on_square(turned: float) -> tuple[float, float]:
    """East and north on the square of half-side 1 after some turns, counterclockwise from the middle of the east."""
    along = 8 * (turned % 1.0)
    if along < 1:
        return 1.0, along
    if along < 3:
        return 2 - along, 1.0
    if along < 5:
        return -1.0, 4 - along
    return (along - 6, -1.0) if along < 7 else (1.0, along - 8)


def fitted(count: int, demands: Demands) -> Dimensions:
    """As many full arms as have UAVs and room in the middle, else the fastest winding arm; the others are followers."""
    found = (_of(some, demands) for some in range(1, count + 1))
    made = min(found, key=lambda made: Spiral(made).sweep_s)
    return made._replace(followers=count - made.fixed)


def _of(count: int, demands: Demands) -> Dimensions:
    half = demands.area_m / 2
    apart_m = demands.apart_m(demands.reach_m / math.sqrt(2))
    needed = math.ceil(half / apart_m)
    lanes = min(needed, count)
    rounds = math.ceil(half / (apart_m * lanes))
    first_m = half / (2 * lanes * rounds)
    teams = max(1, min(count // needed, math.floor(8 * first_m / _ARMS_M)))
    return Dimensions(
        lanes, 0, 0, half, first_m, first_m * (2 * lanes * rounds - 1), demands.height_m, demands.speed_m_s,
        ShapeName.SPIRAL, teams,
    )  # fmt: skip
