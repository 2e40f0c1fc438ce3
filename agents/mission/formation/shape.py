"""What a search formation is: how many places of which kind, and the contract of the shapes in which it is flown.

    lines      two lines abreast part from the middle of the area; a chain between them keeps the swarm in one piece
    spiral     arms abreast turn about the middle, or one arm winds outward from it; any number of UAVs will do
    sectors    a team for each sector, abreast; more UAVs are free for finds, but the swarm comes apart

In all of them places of teams come first (team 0 lane by lane, team 1, ...), then relays, then followers. Every place
moves in straight pieces without jumps. Pure geometry: metres, seconds.
"""

import math
from collections.abc import Iterable
from enum import IntEnum
from typing import Final, NamedTuple, Protocol

from fanet_mw.units import Enu

FOLLOWER_HIGHER_M: Final = 12.0
"""Places of different kinds fly at heights of their own, so that a follower may cross a line."""
FOLLOW_M: Final = 110.0
"""A follower flies so far behind its line."""
_WIDE: Final = 0.9
"""Places that are to hear each other are at most this share of the radio's reach apart."""
_LANES: Final = 1.35
"""The distance of two lanes as a multiple of the range of the phones' receiver."""
EDGE_M: Final = 25.0
"""Lines turn so near to the edge of the area: a camera sees that far."""
FIRST_M: Final = 16.0
"""Lines begin so far from the middle: apart enough not to be in each other's way, and nothing lies behind them."""
_TURN_S: Final = 10.0
"""How long lines stay where they turn, so that a UAV that has fallen behind has seen the edge of the area too."""
_BACK: Final = 1.2
"""The way back is flown so much faster than the sweep: where survivors are is known by then."""


class ShapeName(IntEnum):
    """The shapes by the numbers that they have on the air; their names are those of the key `mission.search`."""

    LINES = 0
    SPIRAL = 1
    SECTORS = 2


class Demands(NamedTuple):
    """What a formation has to do: sweep a square area, in reach of each other."""

    area_m: float
    seen_m: float
    """A UAV in its lane finds a phone so far to the side, on the ground."""
    reach_m: float
    """The reach of the radio."""
    height_m: float
    speed_m_s: float

    def apart_m(self, reach_m: float) -> float:
        """The greatest distance of two lanes, if neighbors hear each other from so far."""
        return min(_WIDE * reach_m, _LANES * self.seen_m)

    @property
    def hop_m(self) -> float:
        """The greatest distance of two places that pass on what the swarm says."""
        return _WIDE * self.reach_m


class Dimensions(NamedTuple):
    """A formation in numbers, as the plan hands it out."""

    lanes: int
    """The number of places of each team."""
    relays: int
    followers: int
    half_width_m: float
    """Lines: the outermost lanes are this far from the middle. Others: half the width of the area."""
    first_m: float
    """The distance of each line from its beginning at first; of a spiral, that of the innermost lane from the
    middle."""
    last_m: float
    """The same distance when the sweep turns; of a spiral, that of the outermost lane."""
    height_m: float
    speed_m_s: float
    shape: ShapeName = ShapeName.LINES
    teams: int = 2

    @property
    def fixed(self) -> int:
        """The number of places that sweep the area and hold the swarm together: all but the followers."""
        return self.teams * self.lanes + self.relays

    @property
    def places(self) -> int:
        return self.fixed + self.followers

    def line(self, team: int) -> range:
        """The places of a team, lane by lane."""
        return range(team * self.lanes, (team + 1) * self.lanes)

    def team_of(self, place: int) -> int:
        """The team that a place belongs to; of a relay, the nearer one."""
        if place < self.teams * self.lanes:
            return place // self.lanes
        if place < self.fixed:
            return (place - self.teams * self.lanes) * self.teams // self.relays
        return self.follower(place)[0]

    def follower(self, place: int) -> tuple[int, float]:
        """The team of a follower, and where it flies along its line, from 0 to 1; each line is divided evenly."""
        which = place - self.fixed
        team = which % self.teams
        of_team = (self.followers + self.teams - 1 - team) // self.teams
        return team, (which // self.teams + 0.5) / of_team


class Shape(Protocol):
    """The positions of the places of one formation."""

    @property
    def sweep_s(self) -> float:
        """The time from the beginning of a sweep to its turn."""
        ...

    @property
    def lane_m(self) -> float:
        """The distance of two lanes."""
        ...

    def at(self, place: int, swept_s: float) -> Enu:
        """The position of a place when the sweep has lasted so long; before 0 it is where the sweep begins."""
        ...

    def tethers(self, place: int) -> tuple[int, ...]:
        """The places that this one must stay in reach of, so that the formation holds together; none for a follower."""
        ...

    def outward(self, place: int) -> range:
        """The places of its line from this one to the outermost: who is lost is replaced by the next in this order."""
        ...

    def apart_m(self, team: int, east_m: float, north_m: float, swept_s: float) -> float:
        """The distance of a spot from the line of a team then."""
        ...


def nearest_m(places: Iterable[Enu], east_m: float, north_m: float) -> float:
    """The distance of a spot from the nearest of some places, on the map."""
    return min(math.hypot(place.east - east_m, place.north - north_m) for place in places)


def swept_m(formation: Dimensions, swept_s: float) -> float:
    """The distance of a line from its beginning: out at the speed of the sweep, back faster, again and again."""
    if swept_s <= 0:
        return formation.first_m
    out_s = (formation.last_m - formation.first_m) / formation.speed_m_s
    along_s = swept_s % (out_s + _TURN_S + out_s / _BACK)
    if along_s <= out_s:
        return formation.first_m + along_s * formation.speed_m_s
    return formation.last_m - max(0.0, along_s - out_s - _TURN_S) * formation.speed_m_s * _BACK
