"""The formation `sectors`: the area is divided into equal sectors in rows, and each is swept by a team of UAVs abreast.

The teams of a row move in step, side by side. There are no relays between rows, so more UAVs are followers than in
other formations. Rows in the south of the area are swept southward, others northward, as is a middle or an only one:
two rows begin beside each other, part, and meet on the way back.
"""

import math

from agents.mission.search_formation.shapes.contract import (
    EDGE_M,
    FIRST_M,
    FOLLOW_M,
    FOLLOWER_HIGHER_M,
    Demands,
    Dimensions,
    Shape,
    ShapeName,
    shifted_m,
    swept_m,
)
from fanet_mw.units import Enu


class Sectors(Shape):
    """The positions of the places of all teams and of their followers."""

    def __init__(self, formation: Dimensions) -> None:
        self._formation = formation
        rows, columns = rows_of(formation.teams), formation.teams // rows_of(formation.teams)
        self._rows, self._columns = rows, columns
        self._width_m = 2 * formation.half_width_m / columns
        self._depth_m = 2 * formation.half_width_m / rows

    @property
    def lane_m(self) -> float:
        return self._width_m / self._formation.lanes

    @property
    def sweep_s(self) -> float:
        return (self._formation.last_m - self._formation.first_m) / self._formation.speed_m_s

    def at(self, place: float, swept_s: float) -> Enu:
        formation = self._formation
        if place < formation.fixed:
            team, lane = divmod(place, formation.lanes)
            share = (lane + 0.5) / formation.lanes
            return self._at(int(team), share, swept_m(formation, swept_s), formation.height_m)
        team, share = formation.follower(round(place))
        behind_m = max(swept_m(formation, swept_s) - FOLLOW_M, formation.first_m * 0.5)
        return self._at(team, share, behind_m, formation.height_m + FOLLOWER_HIGHER_M)

    def _at(self, team: int, share: float, along_m: float, up_m: float) -> Enu:
        row, column = divmod(team, self._columns)
        half = self._formation.half_width_m
        southern, east = -half + row * self._depth_m, -half + (column + share) * self._width_m
        outward_is_north = 2 * row + 1 >= self._rows
        return Enu(east, southern + along_m if outward_is_north else southern + self._depth_m - along_m, up_m)

    def flown_at(self, place: float, swept_s: float) -> Enu:
        at, formation = self.at(place, swept_s), self._formation
        if place >= formation.fixed:
            return at
        aside_m = shifted_m(swept_s, self.sweep_s, lane_m=self.lane_m, speed_m_s=formation.speed_m_s)
        return at._replace(east=at.east + aside_m)

    def tethers(self, place: int) -> tuple[int, ...]:
        formation = self._formation
        if place >= formation.fixed:
            return ()
        team, lane = divmod(place, formation.lanes)
        column = team % self._columns
        found = [place - 1] if lane > 0 or column > 0 else []
        found += [place + 1] if lane < formation.lanes - 1 or column < self._columns - 1 else []
        return tuple(found)


def rows_of(teams: int) -> int:
    """As many rows as columns if possible, otherwise the greatest smaller divisor."""
    return next(rows for rows in range(math.isqrt(teams), 0, -1) if teams % rows == 0)


def fitted(count: int, teams: int, demands: Demands) -> Dimensions | None:
    """The teams for `teams` sectors, all left over as followers; None if too few to span every sector."""
    rows = rows_of(teams)
    depth_m, width_m = demands.area_m / rows, demands.area_m * rows / teams
    lanes = math.ceil(width_m / demands.apart_m(demands.reach_m))
    followers = count - teams * lanes
    if followers < 0:
        return None
    last_m = depth_m - min(EDGE_M, depth_m / 4)
    return Dimensions(
        lanes, 0, followers, demands.area_m / 2, min(FIRST_M, last_m / 2), last_m, demands.height_m, demands.speed_m_s,
        ShapeName.SECTORS, teams,
    )  # fmt: skip
