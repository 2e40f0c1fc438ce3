"""What a search formation is: its places and their kinds, and the contract of the shapes in which it is flown.

    place      the moving position that the plan assigns to one UAV, and its number
    team       UAVs that sweep abreast: a line, an arm of a spiral, or the team of a sector
    lane       the course of one place of a team, and its number within the team
    relay      a place that only keeps two teams within radio reach of each other
    follower   a place behind a team that nothing depends on, so that its UAV may leave it

Places of teams come first (team 0 lane by lane, team 1, ...), then relays, then followers. No place jumps. The sweep is
the flight out to the edge of the area; it ends with a turn, and is repeated after the way back.
"""

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import Final, NamedTuple, Protocol

from fanet_mw.units import Enu

FOLLOWER_HIGHER_M: Final = 12.0
"""Followers fly this much higher than teams, so that a follower may cross a team."""
FOLLOW_M: Final = 110.0
"""The distance of a follower behind its team, in lines and sectors."""
_SQUARE_EDGE_M: Final = 60.0
"""Rings, fans, and lines of few UAVs turn no farther from the edge of the area than this."""
_WIDE: Final = 0.9
"""Two places that must be within reach of each other are at most this share of the radio's reach apart."""
_LANES: Final = 1.35
"""The distance of two lanes is at most this multiple of the distance to the side at which a phone is received."""
EDGE_M: Final = 25.0
"""Lines and rings with enough UAVs, and teams of sectors, turn at this distance from the edge, because cameras see the
edge from there. In a small area it is less."""
FIRST_M: Final = 16.0
"""The distance of each line from the middle, or of a sector's team from the side where its sweep begins, at the
beginning: far enough for two teams not to be in each other's way, and near enough to receive what lies behind them."""
TURN_S: Final = 10.0
"""How long lines and sectors' teams wait at the edge, so that a UAV that has fallen behind gets there, too."""
SHIFT: Final = 1.15
"""The greatest speed at which a team shifts sideways at a turn, as a multiple of the speed of the sweep."""
BACK: Final = 1.2
"""The speed on the way back, as a multiple of the speed of the sweep; most phones have been received by then."""


class ShapeName(IntEnum):
    """The numbers of the shapes in air messages; in lower case the names are values of the key `mission.search`."""

    LINES = 0
    SPIRAL = 1
    SECTORS = 2
    RING = 3
    CIRCUIT = 4
    FAN = 5


class RowKind(IntEnum):
    """How the UAVs of a row share its length when one of them is lost."""

    SPAN = 0
    """From its first place to its last one."""
    BETWEEN = 1
    """Between two others, as the relays of a chain do."""
    AROUND = 2
    """All around: the last place is beside the first one."""


class RowOfPlaces(NamedTuple):
    """Consecutive places whose UAVs close ranks when one of them is lost: they share the length of the row evenly."""

    first: int
    size: int
    kind: RowKind

    @property
    def places(self) -> range:
        return range(self.first, self.first + self.size)

    def shared(self, vacant: frozenset[int]) -> dict[int, float]:
        """Where on the row, between its places' numbers, each UAV left flies, in order; none if nobody is lost."""
        left = [place for place in self.places if place not in vacant]
        if not left or len(left) == self.size:
            return {}
        if self.kind is RowKind.AROUND:
            step = self.size / len(left)
            turned = math.fsum(place - rank * step for rank, place in enumerate(left)) / len(left)
            return {place: (turned + rank * step) % self.size for rank, place in enumerate(left)}
        if self.kind is RowKind.BETWEEN:
            step = (self.size + 1) / (len(left) + 1)
            return {place: self.first - 1 + (rank + 1) * step for rank, place in enumerate(left)}
        if len(left) == 1:
            return {left[0]: self.first + (self.size - 1) / 2}
        step = (self.size - 1) / (len(left) - 1)
        last = self.places[-1]  # rounding errors must not lead beyond it
        return {place: min(self.first + rank * step, last) for rank, place in enumerate(left)}

    def left(self, vacant: frozenset[int]) -> int:
        """The number of UAVs of the row that are left."""
        return self.size - len(vacant.intersection(self.places))

    def nearest(self, place: int, vacant: frozenset[int]) -> tuple[int, float]:
        """Of those left, the place that flies nearest to a place of the row, and where; itself if none is left."""
        shared = self.shared(vacant)
        flown = [(other, shared.get(other, float(other))) for other in self.places if other not in vacant]
        return min(flown, key=lambda one: (round(abs(one[1] - place), 6), one[0]), default=(place, float(place)))


class Demands(NamedTuple):
    """The requirements that a formation is fitted to: the square area that it sweeps, and the reach of receivers."""

    area_m: float
    seen_m: float
    """The distance to the side of a lane at which a phone on the ground is received, without shadowing."""
    reach_m: float
    """The reach of the radio."""
    height_m: float
    speed_m_s: float
    base_m: tuple[float, float] = (0.0, 0.0)
    """East and north of the place where the UAVs start."""

    def apart_m(self, reach_m: float) -> float:
        """The greatest distance of two neighboring lanes, if their UAVs have to be within `reach_m` of each other."""
        return min(_WIDE * reach_m, _LANES * self.seen_m)

    @property
    def phones_limit(self) -> bool:
        """True if lanes lie nearer to each other for the phones than they would for the radio."""
        return self.apart_m(self.reach_m) < self.hop_m

    @property
    def hop_m(self) -> float:
        """The greatest distance of two neighboring relays."""
        return _WIDE * self.reach_m

    @property
    def edge_m(self) -> float:
        """The distance from the edge of the area at which rings, fans, and lines of few UAVs turn."""
        return min(_SQUARE_EDGE_M, self.area_m / 8, self.seen_m / 2)


class Dimensions(NamedTuple):
    """A formation in numbers, as the plan (`FANET_SEARCH`) states it."""

    lanes: int
    """The number of places of each team."""
    relays: int
    followers: int
    half_width_m: float
    """Lines: how far east and west of the middle the outermost lanes are. Other shapes: half the side of the area."""
    first_m: float
    """Lines: the distance of the innermost lines from the middle when a sweep begins. Sectors: the distance of each
    team from the side where its sweep begins. Spiral: the half-side of the innermost square. Fan: how far the base is
    to the east of the middle."""
    last_m: float
    """Lines and sectors: the same distance at the turn; the next lines began there. Spiral: the half-side of the
    outermost square. Fan: how far the base is to the north of the middle."""
    height_m: float
    speed_m_s: float
    shape: ShapeName = ShapeName.LINES
    teams: int = 2
    narrower_m: float = 0.0
    """Lines: by how much nearer to the middle than `half_width_m` the outermost lanes begin the first sweep."""

    @property
    def fixed(self) -> int:
        """The number of places that sweep the area and hold the swarm together: all but the followers."""
        return self.teams * self.lanes + self.relays

    @property
    def turns(self) -> bool:
        """True if lanes change their direction in the middle of a sweep, as those of a spiral do at its corners."""
        return self.shape in (ShapeName.SPIRAL, ShapeName.CIRCUIT)

    @property
    def places(self) -> int:
        return self.fixed + self.followers

    def line(self, team: int) -> range:
        """The places of a team, lane by lane."""
        return range(team * self.lanes, (team + 1) * self.lanes)

    def team_of(self, place: int) -> int:
        """The team of a place; for a relay, the team that is nearer to it."""
        if place < self.teams * self.lanes:
            return place // self.lanes
        if place < self.fixed:
            return (place - self.teams * self.lanes) * self.teams // self.relays
        return self.follower(place)[0]

    def follower(self, place: int) -> tuple[int, float]:
        """The team of a follower, and where along it from 0 to 1: followers are evenly distributed."""
        which = place - self.fixed
        if self.followers <= self.teams > 2:
            return (2 * which + 1) * self.teams // (2 * self.followers), 0.25 + 0.5 * (which % 2)
        team = which % self.teams
        of_team = (self.followers + self.teams - 1 - team) // self.teams
        return team, (which // self.teams + 0.5) / of_team


class Swarm(NamedTuple):
    """How UAVs stand before they take up a formation."""

    uavs: int
    sides_m: tuple[float, float, float, float]
    """How far from the middle of the area they are to the east, west, north and south."""
    reach_m: float

    @property
    def hop_m(self) -> float:
        """The greatest distance of two neighboring relays."""
        return _WIDE * self.reach_m

    @property
    def apart_m(self) -> float:
        """How far neighbors are apart, as in a square grid of the same size."""
        east_m, west_m, north_m, south_m = self.sides_m
        return math.sqrt((east_m + west_m) * (north_m + south_m) / self.uavs)


def swarm_at(positions: Sequence[Enu], *, reach_m: float) -> Swarm:
    east, north = [at.east for at in positions], [at.north for at in positions]
    sides_m = max(east, default=0.0), -min(east, default=0.0), max(north, default=0.0), -min(north, default=0.0)
    return Swarm(len(positions), sides_m, reach_m)


class Shape(Protocol):
    """The contract of a shape: its places over time. `swept_s`: since the first sweep began; before 0 as at 0."""

    _formation: Dimensions

    @property
    def sweep_s(self) -> float:
        """The time from the beginning of a sweep to its turn; of full arms of a spiral, of one turn together."""
        ...

    @property
    def lane_m(self) -> float:
        """The distance of two neighboring lanes; of a spiral, on the sides of the squares, not at the corners."""
        ...

    def at(self, place: float, swept_s: float) -> Enu:
        """The position of a place at an instant of the sweep; of a number between two places of a row, between them."""
        ...

    def flown_at(self, place: float, swept_s: float) -> Enu:
        """The same, turned or shifted between its lanes as the formation is then."""
        return self.at(place, swept_s)

    def may_leave(self, place: float, swept_s: float, *, reach_m: float, left: int) -> bool:
        """True while a UAV of a team may leave, with so many left of its row, if those beside it do not."""
        return False

    def tethers(self, place: int) -> tuple[int, ...]:
        """The places that must stay within radio reach of this one to keep the swarm connected; none for a follower."""
        ...

    def rows(self) -> tuple[RowOfPlaces, ...]:
        """The rows in which UAVs close ranks, by default each team; followers are in none."""
        lanes = self._formation.lanes
        return tuple(RowOfPlaces(team * lanes, lanes, RowKind.SPAN) for team in range(self._formation.teams))

    def drawn_in(self, vacant: frozenset[int], hop_m: float) -> "Shape":
        """The same formation, where possible no larger than the UAVs left of each row span with hops of `hop_m`."""
        return self

    def begun_around(self, swarm: Swarm) -> tuple[Dimensions, ...]:
        """Dimensions of the shape begun where a swarm stands, the fastest first; none if it begins as it is."""
        return ()

    def apart_m(self, team: int, east_m: float, north_m: float, swept_s: float) -> float:
        """The horizontal distance of a point from a team at an instant of the sweep."""
        places = (self.at(place, swept_s) for place in self._formation.line(team))
        return min(math.hypot(place.east - east_m, place.north - north_m) for place in places)


def shifted_m(swept_s: float, sweep_s: float, *, lane_m: float, speed_m_s: float, faster_back: float = BACK) -> float:
    """How far east of their lanes places are: at turns they shift between lanes and back, to show other ground."""
    turn, into_s = divmod(swept_s - sweep_s, sweep_s + TURN_S + sweep_s / faster_back)
    share = min(1.0, into_s / TURN_S)
    most_m = min(lane_m / 2, SHIFT * TURN_S * speed_m_s)
    return 0.0 if turn < 0 else most_m * (1 - share if turn % 2 else share)


def swept_m(formation: Dimensions, swept_s: float, *, faster_back: float = BACK, turn_s: float = TURN_S) -> float:
    """How far a line has flown from the middle, or a sector's team from its side: out, a wait, `faster_back`, again."""
    if swept_s <= 0:
        return formation.first_m
    out_s = (formation.last_m - formation.first_m) / formation.speed_m_s
    along_s = swept_s % (out_s + turn_s + out_s / faster_back)
    if along_s <= out_s:
        return formation.first_m + along_s * formation.speed_m_s
    return formation.last_m - max(0.0, along_s - out_s - turn_s) * formation.speed_m_s * faster_back
