"""The formation `spiral`: arms abreast turn about the middle of the area, their lanes on squares inside each other.

    +-----------------+     lane k flies the square of half-side (2 k + 1) x `first_m`; all lanes of an arm are on one
    | +-------------+ |     ray from the middle, so neighbors are at most a lane times the root of 2 apart, always
    | | +---------+ | |
    | | |    o-o-o-o-o      several arms, as long as the area is wide: each sweeps its share of a turn, and they meet
    | | +---------+ | |     in the middle
    | +-------------+ |     one arm that is shorter: it flies a first turn in the middle, and winds outward from there
    +-----------------+     until its last turn is along the edge; then the same way back

This is the expanding square of IAMSAR, volume II, flown by many UAVs: the middle is seen first, and any number of UAVs
is enough. The outermost lane flies at the speed of the sweep, the others in proportion.
"""

import math
from typing import Final

from agents.mission.formation.shape import FOLLOWER_HIGHER_M, Demands, Dimensions, ShapeName, nearest_m
from fanet_mw.units import Enu

_BEHIND_S: Final = 15.0
"""A follower is where its arm was this long ago."""
_ARMS_M: Final = 60.0
"""The least distance of the innermost lanes of two arms, along their square."""


class Spiral:
    """The arms of one spiral."""

    def __init__(self, formation: Dimensions) -> None:
        self._formation = formation
        lanes, first_m = formation.lanes, formation.first_m
        self._outer_m = first_m * (2 * lanes - 1)
        """The half-side of the square of the outermost lane in the first turn."""
        self._pitch_m = 2 * first_m * lanes
        """By how much each lane moves outward in each turn that winds outward."""
        rounds = (formation.last_m / first_m + 1) / (2 * lanes)
        self._winds = max(0, round(rounds) - 1)
        """The number of turns that wind outward; the first and the last turn do not."""

    @property
    def lane_m(self) -> float:
        return 2 * self._formation.first_m

    @property
    def sweep_s(self) -> float:
        if not self._winds:
            return 8 * self._outer_m / (self._formation.teams * self._formation.speed_m_s)
        return self._way_m(self._winds + 2) / self._formation.speed_m_s

    def at(self, place: int, swept_s: float) -> Enu:
        formation = self._formation
        swept_s = max(0.0, swept_s)
        if place < formation.fixed:
            team, lane = divmod(place, formation.lanes)
            return self._at(team, lane, swept_s, formation.height_m)
        team, share = formation.follower(place)
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

    def outward(self, place: int) -> range:
        lanes = self._formation.lanes
        return range(place, (place // lanes + 1) * lanes if place < self._formation.fixed else place + 1)

    def apart_m(self, team: int, east_m: float, north_m: float, swept_s: float) -> float:
        return nearest_m((self.at(place, swept_s) for place in self._formation.line(team)), east_m, north_m)

    def _at(self, team: int, lane: float, swept_s: float, up_m: float) -> Enu:
        turned = self._turned(swept_s)
        half_m = self._formation.first_m * (2 * lane + 1) + self._pitch_m * self._wound(turned)
        east, north = _on_square(turned + team / self._formation.teams)
        return Enu(half_m * east, half_m * north, up_m)

    def _wound(self, turned: float) -> float:
        return min(max(0.0, turned - 1), self._winds)

    def _way_m(self, turned: float) -> float:
        """A lower bound of the way that the outermost lane has flown after this many turns."""
        wound = self._wound(turned)
        level = turned - wound
        first = min(level, 1.0)
        outward = wound * (8 * self._outer_m + math.sqrt(2) * self._pitch_m) + 4 * self._pitch_m * wound * wound
        return 8 * self._outer_m * first + outward + 8 * (self._outer_m + self._pitch_m * wound) * (level - first)

    def _turned(self, swept_s: float) -> float:
        """The number of turns flown; at its end, a spiral that winds outward goes back the same way, and so on."""
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
        # 4 pitch w^2 + (8 outer + sqrt(2) pitch) w = way, for w turns that have wound outward
        square, linear, rest = 4 * self._pitch_m, first_m + math.sqrt(2) * self._pitch_m, way_m - first_m
        return 1 + 2 * rest / (linear + math.sqrt(linear * linear + 4 * square * rest))


def _on_square(turned: float) -> tuple[float, float]:
    """East and north on the square of half-side 1 after this part of a turn, from the middle of its eastern side."""
    along = 8 * (turned % 1.0)
    if along < 1:
        return 1.0, along
    if along < 3:
        return 2 - along, 1.0
    if along < 5:
        return -1.0, 4 - along
    return (along - 6, -1.0) if along < 7 else (1.0, along - 8)


def fitted(count: int, demands: Demands) -> Dimensions:
    """The spiral for this number of UAVs: as many arms as reach from the middle to the edge, or a shorter one that
    winds outward.
    """
    half = demands.area_m / 2
    apart_m = demands.apart_m(demands.reach_m / math.sqrt(2))
    needed = math.ceil(half / apart_m)
    lanes = min(needed, count)
    rounds = math.ceil(half / (apart_m * lanes))
    first_m = half / (2 * lanes * rounds)
    teams = max(1, min(count // needed, math.floor(8 * first_m / _ARMS_M)))
    return Dimensions(
        lanes, 0, count - teams * lanes, half, first_m, first_m * (2 * lanes * rounds - 1), demands.height_m,
        demands.speed_m_s, ShapeName.SPIRAL, teams,
    )  # fmt: skip
