"""The formation `lines`: lines of UAVs that part from the middle of the area, with chains between them, and followers.

            line 0   o--o--o--o--o--o--o        both lines, nearly as wide as the area, begin near its middle and
                              |                 sweep away from each other to its edges, then back between the lanes of
            followers   x  x  |  x  x           the way out; followers fly behind their line and are free to leave it
                              |  chain          the relays of the chain spread as the lines part
            line 1   o--o--o--o--o--o--o

With UAVs enough there are more lines, each with a share of its half. Lines of a swarm that stands spread over the
middle of the area begin a little beyond it, little wider than it, bent back at both ends, with the chain folded to an
S: what is between them was heard by those who stood there, and the outermost lanes first fly to the sides.

Between two turns a place of other lines moves straight at constant speed, a relay but for one change when the lines
have flown `_STRAIGHT_M`. Distances are convex in between, so a pair within radio reach at these three instants is so
all the time; for lines that begin around the swarm it is checked (`bends_within`).
"""

import itertools
import math
from typing import Final

from agents.mission.search_formation.shapes.contract import (
    BACK,
    EDGE_M,
    FIRST_M,
    FOLLOW_M,
    FOLLOWER_HIGHER_M,
    Demands,
    Dimensions,
    RowKind,
    RowOfPlaces,
    Shape,
    Swarm,
    shifted_m,
    swept_m,
)
from fanet_mw.units import Enu

_CHAIN_HIGHER_M: Final = 6.0
"""Relays fly this much higher than the lines."""
_BUNCHED_M: Final = 280.0
"""While the lines are near each other, relays due north and south of each other would be too close together. They are
therefore displaced to the east and the west as well, at first by up to this distance."""
_FOLDED_M: Final = 32.0
"""Relays between lines that begin around the swarm are displaced by up to this much for each relay: an S, in which they
are near where they stand.
"""
_STRAIGHT_M: Final = 300.0
"""Once the lines have flown this far, the relays are no longer displaced: the chain is a straight line to the north."""
_SIDE_M: Final = 65.0
"""The greatest distance of the outermost lanes from the edge, at most a quarter of the area's side."""
_SHOWN_M: Final = 45.0
"""The outermost lanes are this far from the edge if that takes no further lane: from there cameras show the edge."""
_ENDS_M: Final = 60.0
"""The outermost lanes of lines that begin around the swarm begin at most this far from the middle: cameras show what is
between both lines there, where nobody else comes by."""
_LEAST_LANES: Final = 2
"""The least number of lanes of a line, which has one at each end."""
_LEAST_APART_M: Final = 60.0
"""The least distance of two lines on the same side of the middle."""
_LEAST_BENT: Final = 5
"""Lines that begin around the swarm have so many lanes, at least."""
_BENT: Final = 4
"""Of lines that begin around the swarm, so many lanes at each end are bent back, or all to the middle one."""
_BENT_HOP: Final = 0.85
"""Neighbors of bent lines are at most this share of the radio's reach apart: less than elsewhere, because the outermost
are the fastest and have the farthest way, and so that a line from which two are lost holds together."""
_BEYOND_M: Final = 120.0
"""Lines begin at most this far beyond the outer rows of a swarm, which have time to fly there before the sweep, and
search on the way.
"""
_AROUND: Final = 2.2
"""Lines that begin around the swarm do so at this many times the radio's reach from the middle at most: whoever is
nearer and was not found on the way out is found on the way back only."""
_WIDER: Final = 1.3
"""Lines that begin around the swarm are this much wider than it at first, if neighbors stay in reach."""
_STEPS: Final = 8
"""Lines to which the swarm would not stay together begin nearer, by one of so many steps each time."""
_CHECKS: Final = 40
"""The number of steps of a sweep at which neighbors of bent lines are checked."""
_DENSE: Final = 0.85
"""UAVs in a square grid at this share of the radio's reach, or nearer to each other, hear all between them."""
_FREE: Final = 4
"""More than two lines are flown only if they leave so many followers, who are free for survivors."""


class Lines(Shape):
    """The positions of the places of all lines, their chains and their followers."""

    def __init__(
        self,
        formation: Dimensions,
        *,
        most_m: float = math.inf,
        widest_m: tuple[float, ...] = (),
        gaps_m: tuple[float, ...] = (),
        joints: tuple[float, ...] = (),
    ) -> None:
        """`most_m`: the farthest innermost lines, and `gaps_m`: distances of lines from the north, that the relays left
        span; `widest_m`: half of the width that the UAVs left of each line span; `joints`: the lane of each line at
        which chains end, by default the middle one.
        """
        self._formation = formation
        self._joints = joints or (formation.lanes // 2,) * formation.teams
        self._most_m, self._widest_m = most_m, widest_m or (math.inf,) * formation.teams
        self._half = half = formation.teams // 2
        self._apart_m = formation.last_m - formation.first_m
        straight_s = self._apart_m / formation.speed_m_s
        self._fastest_m_s = BACK * formation.speed_m_s
        back_s = (formation.last_m - min(FIRST_M, formation.first_m)) / self._fastest_m_s
        self._aside_s = formation.narrower_m / self._fastest_m_s
        """The time in which the outermost lanes of bent lines reach the sides of the area."""
        self._sweep_s = straight_s
        if _is_bent(formation):
            self._sweep_s = max(straight_s, *(self._arrives_s(lane) for lane in range(formation.lanes // 2)))
        self._faster_back = self._sweep_s / back_s
        first_m = min(FIRST_M, formation.first_m)
        self._back = formation._replace(first_m=first_m, speed_m_s=(formation.last_m - first_m) / self._sweep_s)
        """How bent lines fly once they have turned: straight, and as long between middle and edge as the first time."""
        gaps_m = gaps_m or (self._apart_m,) * (formation.teams - 1)
        northern, southern = gaps_m[: half - 1][::-1], gaps_m[half:]
        self._outward_m = tuple(
            math.fsum((northern if line < half else southern)[: half - 1 - line if line < half else line - half])
            for line in range(formation.teams)
        )
        """How much farther from the middle each line is than the innermost one on its side."""
        of_side = formation.relays // formation.teams
        sizes = [of_side] * (formation.teams - 1)
        sizes[half - 1] = formation.relays - (formation.teams - 2) * of_side
        starts = [formation.teams * formation.lanes + sum(sizes[:chain]) for chain in range(formation.teams - 1)]
        self._chains = tuple(
            RowOfPlaces(start, size, RowKind.BETWEEN) for start, size in zip(starts, sizes, strict=True)
        )

    @property
    def sweep_s(self) -> float:
        return self._sweep_s

    @property
    def lane_m(self) -> float:
        return 2 * min(max(self._widest_m), self._formation.half_width_m) / (self._formation.lanes - 1)

    def at(self, place: float, swept_s: float) -> Enu:
        formation = self._formation
        lanes = formation.lanes
        if place <= formation.teams * lanes - 1:
            line, lane = divmod(place, lanes)
            inner_m = self._inner_m(swept_s, lane)
            return Enu(self._lane(int(line), lane, swept_s), self._north_m(int(line), inner_m), formation.height_m)
        if place < formation.fixed:
            inner_m = self._inner_m(swept_s, lanes // 2)
            chain, row = next((c, row) for c, row in enumerate(self._chains) if place < row.first + row.size)
            share = 1 - 2 * (place - row.first + 1) / (row.size + 1)
            north, south = (self._lane(line, self._joints[line], swept_s) for line in (chain, chain + 1))
            up_m, middle = formation.height_m + _CHAIN_HIGHER_M, (north + south + share * (north - south)) / 2
            if chain != self._half - 1:
                ends = self._north_m(chain, inner_m), self._north_m(chain + 1, inner_m)
                return Enu(middle, (sum(ends) + share * (ends[0] - ends[1])) / 2, up_m)
            begins_m = self._begins_m(swept_s)
            folded = max(0.0, 1 - (inner_m - begins_m) / _STRAIGHT_M)
            east = -_BUNCHED_M * share * folded
            if begins_m > FIRST_M:
                east = -_FOLDED_M * formation.relays * math.sin(math.pi * share) * folded
            return Enu(middle + east, share * inner_m, up_m)
        line, share = formation.follower(round(place))
        outward_m, lane = self._outward_m[line], share * (lanes - 1)
        behind_m = FOLLOW_M if not outward_m else min(FOLLOW_M, self._apart_m / 2)
        least_m = min(self._begins_m(swept_s), self._starts_m(self._straight(lane))) / 2
        behind = max(self._inner_m(swept_s, lane) + outward_m - behind_m, least_m)
        east = self._half_width_m(line, swept_s) * (2 * share - 1)
        return Enu(east, behind if line < self._half else -behind, formation.height_m + FOLLOWER_HIGHER_M)

    def flown_at(self, place: float, swept_s: float) -> Enu:
        """The easternmost lane stays where it is when the others shift."""
        at, formation = self.at(place, swept_s), self._formation
        if place >= formation.fixed:
            return at
        lane = place % formation.lanes if place <= formation.teams * formation.lanes - 1 else formation.lanes // 2
        whole_m = shifted_m(
            swept_s, self.sweep_s, lane_m=self.lane_m, speed_m_s=formation.speed_m_s, faster_back=self._faster_back
        )
        return Enu(at.east + whole_m * min(1.0, formation.lanes - 1 - lane), at.north, at.up)

    def tethers(self, place: int) -> tuple[int, ...]:
        formation = self._formation
        lanes = formation.lanes
        middle = lanes // 2
        found: list[int] = []
        if place < formation.teams * lanes:
            line, lane = divmod(place, lanes)
            found += [place - 1] if lane > 0 else []
            found += [place + 1] if lane < lanes - 1 else []
            if lane == middle:
                found += [self._joined(line - 1)[-2]] if line > 0 else []
                found += [self._joined(line)[1]] if line < formation.teams - 1 else []
        elif place < formation.fixed:
            joined = next(self._joined(c) for c, row in enumerate(self._chains) if place in row.places)
            found += [joined[joined.index(place) - 1], joined[joined.index(place) + 1]]
        return tuple(found)

    def _joined(self, chain: int) -> tuple[int, ...]:
        lanes = self._formation.lanes
        middle = chain * lanes + lanes // 2
        return (middle, *self._chains[chain].places, middle + lanes)

    def rows(self) -> tuple[RowOfPlaces, ...]:
        lanes = self._formation.lanes
        lines = tuple(RowOfPlaces(line * lanes, lanes, RowKind.SPAN) for line in range(self._formation.teams))
        return lines + self._chains

    def drawn_in(self, vacant: frozenset[int], hop_m: float) -> "Lines":
        formation, rows = self._formation, self.rows()
        left = [row.left(vacant) for row in rows]
        lines, relays = rows[: formation.teams], left[formation.teams :]
        widest_m = tuple(
            min(formation.half_width_m, max(1, count - 1) * hop_m / 2) for count in left[: formation.teams]
        )
        joints = tuple(row.nearest(row.first + row.size // 2, vacant)[1] - row.first for row in lines)
        joined_m = [wide_m * self._aside(lane) for wide_m, lane in zip(widest_m, joints, strict=True)]
        aside_m = [a - b for a, b in itertools.pairwise(joined_m)]
        spans_m = [
            math.sqrt(max(0.0, ((count + 1) * hop_m) ** 2 - off_m**2))
            for count, off_m in zip(relays, aside_m, strict=True)
        ]
        gaps_m = tuple(min(self._apart_m, span_m) for span_m in spans_m)
        most_m = spans_m[self._half - 1] / 2
        return Lines(formation, most_m=most_m, widest_m=widest_m, gaps_m=gaps_m, joints=joints)

    def begun_around(self, swarm: Swarm) -> tuple[Dimensions, ...]:
        """These lines, if they are more than two, then fewer of them; at last two that begin beyond the swarm or
        nearer, the farthest first, if it stands densely enough to hear everybody between.
        """
        made = self._formation
        more = tuple(_in_lines(made, of_half, swarm.hop_m) for of_half in range(made.teams // 2, 1, -1))
        two = _in_lines(made, 1, swarm.hop_m) if more else made
        return more + (_around(two, swarm) or ((two,) if more else ()))

    def bends_within(self, hop_m: float) -> bool:
        """True if neighbors in the first sweep are always this near to each other; both ends of a line are alike."""
        to_middle = range(self._formation.lanes // 2 + 1)
        instants = (step * self.sweep_s / _CHECKS for step in range(_CHECKS + 1))
        rows = ([self.at(lane, swept_s) for lane in to_middle] for swept_s in instants)
        return all(a.horizontal_to(b) <= hop_m for row in rows for a, b in itertools.pairwise(row))

    def apart_m(self, team: int, east_m: float, north_m: float, swept_s: float) -> float:
        """The distance of a point from a line to the north or south; a line is taken to be as wide as the area."""
        half_width_m = self._half_width_m(team, swept_s)
        aside = max(-1.0, min(1.0, east_m / half_width_m)) if half_width_m else 0.0
        lane = (aside + 1) / 2 * (self._formation.lanes - 1)
        return abs(north_m - self._north_m(team, self._inner_m(swept_s, lane)))

    def _inner_m(self, swept_s: float, lane: float) -> float:
        """How far from the middle the innermost lines are at a lane."""
        formation = self._formation
        if not _is_bent(formation):
            return min(self._most_m, swept_m(formation, swept_s))
        if swept_s > self.sweep_s:
            return min(self._most_m, swept_m(self._back, swept_s, faster_back=self._faster_back))
        straight = self._straight(lane)
        waits_s, slow_m_s, fast_m_s = self._pace(lane, straight)
        slow_m = max(0.0, min(swept_s, self._aside_s) - waits_s) * slow_m_s
        out_m = self._starts_m(straight) + slow_m + max(0.0, swept_s - self._aside_s) * fast_m_s
        return min(self._most_m, formation.last_m, out_m)

    def _pace(self, lane: float, straight: float) -> tuple[float, float, float]:
        """How long a lane of bent lines waits, and its speeds away from the middle: while it goes aside, and then."""
        fast_m_s = self._formation.speed_m_s * (BACK + straight * (1 - BACK))
        aside_m_s = self._fastest_m_s * abs(self._aside(lane))
        slow_m_s = min(fast_m_s, math.sqrt(self._fastest_m_s**2 - aside_m_s**2))
        return (1 - straight) * self._aside_s, slow_m_s, fast_m_s

    def _arrives_s(self, lane: float) -> float:
        """When a lane of bent lines is where they turn."""
        straight = self._straight(lane)
        waits_s, slow_m_s, fast_m_s = self._pace(lane, straight)
        slow_m = (self._aside_s - waits_s) * slow_m_s
        return self._aside_s + (self._formation.last_m - self._starts_m(straight) - slow_m) / fast_m_s

    def _begins_m(self, swept_s: float) -> float:
        """How far from the middle the innermost lines begin the first sweep, or a later one."""
        return (self._formation if swept_s <= self.sweep_s else self._back).first_m

    def _starts_m(self, straight: float) -> float:
        """How far from the middle a lane begins, by how straight the line is there (`_straight`)."""
        first_m = self._formation.first_m
        ends_m = min(first_m, _ENDS_M)
        return ends_m + straight * (first_m - ends_m)

    def _straight(self, lane: float) -> float:
        """1 for the lanes in the middle of lines that begin around the swarm, and for others; 0 for the outermost."""
        if not _is_bent(self._formation):
            return 1.0
        last = self._formation.lanes - 1
        return min(1.0, min(lane, last - lane) / max(1, min(_BENT, last // 2)))

    def _north_m(self, line: int, inner_m: float) -> float:
        out_m = inner_m + self._outward_m[line]
        return out_m if line < self._half else -out_m

    def _half_width_m(self, line: int, swept_s: float) -> float:
        narrower_m = self._formation.narrower_m
        left = 1 - min(1.0, max(0.0, swept_s) / self._aside_s) if narrower_m else 0.0
        return min(self._widest_m[line], self._formation.half_width_m - left * narrower_m)

    def _lane(self, line: int, lane: float, swept_s: float) -> float:
        return self._half_width_m(line, swept_s) * self._aside(lane)

    def _aside(self, lane: float) -> float:
        """Where along its line a lane is: -1 at the western end, 1 at the eastern one."""
        return 2 * lane / (self._formation.lanes - 1) - 1


def _is_bent(formation: Dimensions) -> bool:
    """True for lines that begin around the swarm: others begin no farther from the middle than `FIRST_M`."""
    return formation.first_m > FIRST_M


def _around(made: Dimensions, swarm: Swarm) -> tuple[Dimensions, ...]:
    """Two lines as they may begin around a swarm, the farthest from the middle first."""
    east_m, west_m, north_m, south_m = swarm.sides_m
    aside_m, beyond_m = (east_m + west_m) / 2, min(north_m, south_m)
    if made.lanes < _LEAST_BENT or beyond_m <= FIRST_M or swarm.apart_m > _DENSE * swarm.reach_m:
        return ()
    most_m = max(made.first_m, min(beyond_m + _BEYOND_M, made.last_m / 2, _AROUND * swarm.reach_m))
    narrower_m = max(0.0, made.half_width_m - _WIDER * aside_m)
    shares = [step / _STEPS for step in range(_STEPS, 0, -1)]
    found = []
    for share in shares:
        first_m = made.first_m + share * (most_m - made.first_m)
        for narrow in (*shares, 0.0):
            begun = made._replace(first_m=first_m, narrower_m=narrow * narrower_m)
            if Lines(begun).bends_within(_BENT_HOP * swarm.reach_m):
                found.append(begun)
                break
    return tuple(found)


def fitted(count: int, demands: Demands) -> Dimensions | None:
    """As many lines as can sweep a square area in one piece; None if they are too few for two. Those too few to reach
    `EDGE_M` turn where all beyond are heard, so much slower that more UAVs need no more time.
    """
    half = demands.area_m / 2
    lane_m = demands.apart_m(demands.reach_m)
    lanes = max(_LEAST_LANES, math.ceil(2 * (half - min(_SIDE_M, half / 2)) / lane_m) + 1)
    half_width = min(half - min(_SHOWN_M, half / 2), (lanes - 1) * lane_m / 2)
    near = min(EDGE_M, half / 2)
    swept = half - near - min(FIRST_M, (half - near) / 2)
    found: Dimensions | None = None
    for of_half, edge in itertools.product(range(1, count // (2 * lanes) + 1), (near, max(near, demands.edge_m))):
        if found is not None and found.teams == 2 * of_half:
            continue
        first = min(FIRST_M, (half - edge) / 2)
        speed_m_s = (half - edge - first) / swept * demands.speed_m_s
        two = Dimensions(
            lanes, 0, count - 2 * lanes, half_width, first, half - edge, demands.height_m, speed_m_s
        )  # fmt: skip
        made = _in_lines(two, of_half, demands.hop_m)
        apart_m = made.last_m - first
        if made.followers >= 0 and (of_half == 1 or (apart_m >= _LEAST_APART_M and made.followers >= _FREE)):
            found = made
    return found


def _in_lines(made: Dimensions, of_half: int, hop_m: float) -> Dimensions:
    """The same UAVs in so many lines on each side of the middle."""
    apart_m = (made.last_m - made.first_m) * (made.teams // 2) / of_half
    relays = _relays(2 * (made.first_m + apart_m), hop_m) + 2 * (of_half - 1) * _relays(apart_m, hop_m)
    followers = made.places - 2 * of_half * made.lanes - relays
    return made._replace(relays=relays, followers=followers, last_m=made.first_m + apart_m, teams=2 * of_half)


def _relays(gap_m: float, hop_m: float) -> int:
    """The number of relays that join two lines at this distance."""
    return max(0, math.ceil(gap_m / hop_m) - 1)
