"""Where each place of the search formation is at every instant: two lines abreast, a chain between them, and followers.

            line 0   o--o--o--o--o--o--o        both lines start beside the middle of the area, as wide as the area,
                              |                 and sweep away from each other to its edges, then back, and again
            followers   x  x  |  x  x           followers fly behind their line and are free to leave it
                              |  chain          the chain between the lines stretches as they part
            line 1   o--o--o--o--o--o--o

Every place moves on a straight line at constant speed between two turns, so the distance of two places is a convex
function of time: a pair within reach at both turns is within reach all the time. Pure geometry: metres, seconds.
"""

import math
from typing import Final, NamedTuple

from fanet_mw.units import Enu

_CHAIN_HIGHER_M: Final = 6.0
_FOLLOWER_HIGHER_M: Final = 12.0
"""Places of different kinds fly at heights of their own, so that a follower may cross a line."""
_WIDE: Final = 0.9
"""Places that are to hear each other are at most this share of the radio's reach apart."""
_BUNCHED_M: Final = 280.0
"""While the lines are near each other, the chain between them lies slantwise, and reaches this far to either side."""
_STRAIGHT_M: Final = 300.0
"""The chain is straight when the lines have flown so far."""
_FOLLOW_M: Final = 110.0
"""How far behind its line a follower flies."""
_FIRST_M: Final = 16.0
"""How far from the middle the lines begin: apart enough not to be in each other's way, and nothing lies behind them."""
_LANES: Final = 1.35
"""The distance of two lanes as a multiple of the range of the phones' receiver."""
_EDGE_M: Final = 25.0
"""How near to the edge of the area the lines turn: a camera sees that far."""
_SIDE_M: Final = 65.0
"""How near to the edge the outermost lanes are: they may be left sideways."""
_TURN_S: Final = 10.0
"""How long the lines stay where they turn, so that whoever has fallen behind has seen the edge of the area too."""
_LEAST_LANES: Final = 2
_BACK: Final = 1.2
"""The way back is flown so much faster than the sweep: where survivors are is known by then."""


class Pattern(NamedTuple):
    """The formation, as the plan hands it out."""

    lanes: int
    """Places of each of the two lines."""
    relays: int
    """Places of the chain between the lines."""
    followers: int
    half_width_m: float
    """The outermost lanes are this far from the middle."""
    first_m: float
    """How far from the middle each line is when its sweep begins."""
    last_m: float
    """How far it is when the sweep turns."""
    height_m: float
    speed_m_s: float

    @property
    def places(self) -> int:
        """How many places there are: line 0 from west to east, line 1, the chain from line 0, followers."""
        return 2 * self.lanes + self.relays + self.followers

    @property
    def sweep_s(self) -> float:
        """From the beginning of a sweep to its turn."""
        return (self.last_m - self.first_m) / self.speed_m_s

    def line_of(self, place: int) -> int:
        """The line that a place belongs to, 0 or 1; of a relay, the nearer one."""
        if place < 2 * self.lanes:
            return place // self.lanes
        place -= 2 * self.lanes
        return int(2 * place >= self.relays) if place < self.relays else (place - self.relays) % 2

    def line(self, place: int) -> range:
        """The places of the line that a place belongs to."""
        first = self.line_of(place) * self.lanes
        return range(first, first + self.lanes)

    def line_north(self, line: int, swept_s: float) -> float:
        """Where a line is."""
        return self._north(swept_s) * (1 if line == 0 else -1)

    def kind(self, place: int) -> str:
        """`line`, `relay` or `follower`."""
        if place < 2 * self.lanes:
            return "line"
        return "relay" if place < 2 * self.lanes + self.relays else "follower"

    def at(self, place: int, swept_s: float) -> Enu:
        """Where a place is when the sweep has lasted so long; before 0 it is where the sweep begins."""
        north = self._north(swept_s)
        lanes = self.lanes
        if place < 2 * lanes:
            line, lane = divmod(place, lanes)
            return Enu(self._lane(lane), north if line == 0 else -north, self.height_m)
        place -= 2 * lanes
        if place < self.relays:
            share = 1 - 2 * (place + 1) / (self.relays + 1)
            east = -_BUNCHED_M * share * max(0.0, 1 - (north - self.first_m) / _STRAIGHT_M)
            return Enu(self._lane(lanes // 2) + east, share * north, self.height_m + _CHAIN_HIGHER_M)
        place -= self.relays
        return self._follower(place, north)

    def velocity(self, place: int, swept_s: float) -> Enu:
        """How the place moves then."""
        if swept_s < 0:
            return Enu(0.0, 0.0, 0.0)
        step_s = 0.05
        early = max(0.0, swept_s - step_s)
        a, b = self.at(place, early), self.at(place, early + step_s)
        return Enu((b.east - a.east) / step_s, (b.north - a.north) / step_s, (b.up - a.up) / step_s)

    @property
    def lane_m(self) -> float:
        """The distance of two lanes."""
        return 2 * self.half_width_m / (self.lanes - 1)

    def tethers(self, place: int) -> tuple[int, ...]:
        """The places that this one must stay in reach of, so that the formation holds together; none for a follower."""
        lanes, relays = self.lanes, self.relays
        middle = lanes // 2
        found: list[int] = []
        if place < 2 * lanes:
            line, lane = divmod(place, lanes)
            found += [place - 1] if lane > 0 else []
            found += [place + 1] if lane < lanes - 1 else []
            if lane == middle:
                chain_end = 2 * lanes + (0 if line == 0 else relays - 1)
                found.append(chain_end if relays else (lanes + middle if line == 0 else middle))
        elif place < 2 * lanes + relays:
            found.append(place - 1 if place > 2 * lanes else middle)
            found.append(place + 1 if place < 2 * lanes + relays - 1 else lanes + middle)
        return tuple(found)

    def _lane(self, lane: int) -> float:
        return self.half_width_m * (2 * lane / (self.lanes - 1) - 1)

    def _north(self, swept_s: float) -> float:
        """Distance of either line from the middle: out at the speed of the sweep, back faster, again and again."""
        if swept_s <= 0:
            return self.first_m
        back_s = self.sweep_s / _BACK
        along_s = swept_s % (self.sweep_s + _TURN_S + back_s)
        if along_s <= self.sweep_s:
            return self.first_m + along_s * self.speed_m_s
        return self.last_m - max(0.0, along_s - self.sweep_s - _TURN_S) * self.speed_m_s * _BACK

    def _follower(self, which: int, north: float) -> Enu:
        """Followers alternate between the lines and divide each evenly."""
        line = which % 2
        of_line = (self.followers + 1 - line) // 2
        east = self.half_width_m * (2 * (which // 2 + 0.5) / of_line - 1)
        behind = max(north - _FOLLOW_M, self.first_m * 0.5)
        up = self.height_m + _FOLLOWER_HIGHER_M
        return Enu(east, behind if line == 0 else -behind, up)


def fitted(
    count: int, *, area_m: float, seen_m: float, reach_m: float, height_m: float, speed_m_s: float
) -> Pattern | None:
    """The formation for so many UAVs that sweeps a square area; None when they are too few for it.

    `seen_m`: how far to the side, on the ground, a UAV in its lane finds a phone. `reach_m`: of the radio.
    """
    half = area_m / 2
    apart = min(_WIDE * reach_m, _LANES * seen_m)
    edge, side = min(_EDGE_M, half / 2), min(_SIDE_M, half / 2)
    half_width = half - side
    lanes = max(_LEAST_LANES, math.ceil(2 * half_width / apart) + 1)
    last = half - edge
    relays = max(0, math.ceil(2 * last / (_WIDE * reach_m)) - 1)
    if 2 * lanes + relays > count:
        return None
    first = min(_FIRST_M, last / 2)
    followers = count - 2 * lanes - relays
    return Pattern(lanes, relays, followers, half_width, first, last, height_m, speed_m_s)
