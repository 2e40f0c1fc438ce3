"""The dimensions of a search formation, and the contract of the shapes in which it is flown.

    lines      two lines abreast part from the middle of the area; a chain between them keeps the swarm connected
    spiral     arms abreast turn about the middle, or one arm winds outward from it; any number of UAVs is enough
    sectors    a team for each sector, abreast; more UAVs are free for survivors, but the swarm separates

In all shapes the places of teams come first (team 0 lane by lane, team 1, ...), then relays, then followers. Each place
moves in straight pieces without jumps. Pure geometry: metres, seconds.
"""

import math
from collections.abc import Iterable
from enum import IntEnum
from typing import Final, NamedTuple, Protocol

from fanet_mw.units import Enu

FOLLOWER_HIGHER_M: Final = 12.0
"""Followers fly this much higher than the lines, so that they can cross them."""
FOLLOW_M: Final = 110.0
"""A follower flies this far behind its line."""
_WIDE: Final = 0.9
"""The greatest distance of two places that must receive each other, as a share of the radio's reach."""
_LANES: Final = 1.35
"""The distance of two lanes, as a multiple of the range at which phones are received."""
EDGE_M: Final = 25.0
"""Lines turn this near to the edge of the area, which is as far as a camera sees."""
FIRST_M: Final = 16.0
"""Lines begin this far from the middle, so that they are not in each other's way and leave nothing out."""
_TURN_S: Final = 10.0
"""How long lines stay where they turn, so that a UAV that has fallen behind reaches the edge of the area, too."""
_BACK: Final = 1.2
"""The way back is faster than the sweep by this factor, because the places of survivors are known by then."""


class ShapeName(IntEnum):
    """The shapes, with the numbers that they have on the air; their names are the values of `mission.search`."""

    LINES = 0
    SPIRAL = 1
    SECTORS = 2


class Demands(NamedTuple):
    """The requirements on a formation: to sweep a square area, with all UAVs within reach of each other."""

    area_m: float
    seen_m: float
    """The greatest horizontal distance at which a UAV in its lane finds a phone."""
    reach_m: float
    """The reach of the radio."""
    height_m: float
    speed_m_s: float

    def apart_m(self, reach_m: float) -> float:
        """The greatest distance of two lanes, if neighbors must be within this reach."""
        return min(_WIDE * reach_m, _LANES * self.seen_m)

    @property
    def hop_m(self) -> float:
        """The greatest distance of two places that relay for the swarm."""
        return _WIDE * self.reach_m


class Dimensions(NamedTuple):
    """The dimensions of a formation, as the plan message states them."""

    lanes: int
    """The number of places of each team."""
    relays: int
    followers: int
    half_width_m: float
    """For lines, the distance of the outermost lanes from the middle; for other shapes, half the width of the area."""
    first_m: float
    """The initial distance of each line from the middle; for a spiral, the half-side of the innermost lane."""
    last_m: float
    """The same distance when the sweep turns; for a spiral, that of the outermost lane."""
    height_m: float
    speed_m_s: float
    shape: ShapeName = ShapeName.LINES
    teams: int = 2

    @property
    def fixed(self) -> int:
        """The number of places that sweep the area and hold the swarm together: all except the followers."""
        return self.teams * self.lanes + self.relays

    @property
    def places(self) -> int:
        return self.fixed + self.followers

    def line(self, team: int) -> range:
        """The places of a team, lane by lane."""
        return range(team * self.lanes, (team + 1) * self.lanes)

    def team_of(self, place: int) -> int:
        """The team to which a place belongs; for a relay, the nearer one."""
        if place < self.teams * self.lanes:
            return place // self.lanes
        if place < self.fixed:
            return (place - self.teams * self.lanes) * self.teams // self.relays
        return self.follower(place)[0]

    def follower(self, place: int) -> tuple[int, float]:
        """The team of a follower, and its position along the line, from 0 to 1; followers are spaced evenly."""
        which = place - self.fixed
        team = which % self.teams
        of_team = (self.followers + self.teams - 1 - team) // self.teams
        return team, (which // self.teams + 0.5) / of_team


class Shape(Protocol):
    """The positions of all places of one formation over time."""

    @property
    def sweep_s(self) -> float:
        """The time from the beginning of a sweep to its turn."""
        ...

    @property
    def lane_m(self) -> float:
        """The distance of neighboring lanes."""
        ...

    def at(self, place: int, swept_s: float) -> Enu:
        """The position of a place after this time of sweeping; before 0, where the sweep begins."""
        ...

    def tethers(self, place: int) -> tuple[int, ...]:
        """The places within whose reach this one must stay, so that the formation is connected; none for a follower."""
        ...

    def outward(self, place: int) -> range:
        """The places of its line from this one outward; a lost UAV is replaced by the next one in this order."""
        ...

    def apart_m(self, team: int, east_m: float, north_m: float, swept_s: float) -> float:
        """The distance of a place on the map from the line of a team after this time of sweeping."""
        ...


def nearest_m(places: Iterable[Enu], east_m: float, north_m: float) -> float:
    """The distance of a place from the nearest of some others, on the map."""
    return min(math.hypot(place.east - east_m, place.north - north_m) for place in places)


def swept_m(formation: Dimensions, swept_s: float) -> float:
    """How far a line has come from its beginning: outward at the speed of the sweep, back faster, again and again."""
    if swept_s <= 0:
        return formation.first_m
    out_s = (formation.last_m - formation.first_m) / formation.speed_m_s
    along_s = swept_s % (out_s + _TURN_S + out_s / _BACK)
    if along_s <= out_s:
        return formation.first_m + along_s * formation.speed_m_s
    return formation.last_m - max(0.0, along_s - out_s - _TURN_S) * formation.speed_m_s * _BACK
