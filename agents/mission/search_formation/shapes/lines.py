"""The formation `lines`: two lines of UAVs that part from the middle of the area, a chain between them, and followers.

            line 0   o--o--o--o--o--o--o        both lines, nearly as wide as the area, begin near its middle and
                              |                 sweep away from each other to its edges, then back, and again
            followers   x  x  |  x  x           followers fly behind their line and are free to leave it
                              |  chain          the relays of the chain spread as the lines part
            line 1   o--o--o--o--o--o--o

With UAVs enough there are more lines, as many to the north as to the south: each sweeps its share of its half and ends
where the next one began, and chains join neighboring ones unless these are within reach of each other anyway.

The teams are the lines, from the northernmost to the southernmost (`contract.py`).

Lines of a swarm that stands spread over the middle of the area begin where it stands, bent back at both ends:

             .-o--o--o--o--o-.        what is between them was heard by those who stood there; beside that the
            o                 o       outermost lanes begin near the middle, and catch up by the edge of the area;
                 (heard)              on the way back all fly to the middle
            o                 o
             '-o--o--o--o--o-'

On its way back each UAV flies between the lanes of its way out.

Between two turns a place of a line moves straight at constant speed, a relay but for one change when the lines have
flown `_STRAIGHT_M`. Distances are convex in between, so a pair within radio reach at these three instants is so all the
time.
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
therefore displaced to the east and the west as well, at first by up to this distance; by half of it between lines that
begin around the swarm, whose relays must have a short way to their places."""
_STRAIGHT_M: Final = 300.0
"""Once the lines have flown this far, the relays are no longer displaced: the chain is a straight line to the north."""
_SIDE_M: Final = 65.0
"""The distance of the outermost lanes from the edge, at most a quarter of the area's side; it leaves room to shift."""
_LEAST_LANES: Final = 2
"""The least number of lanes of a line, which has one at each end."""
_LEAST_APART_M: Final = 60.0
"""The least distance of two lines on the same side of the middle."""
_BENT: Final = 3
"""Of lines that begin around the swarm, so many lanes at each end are bent back to the middle."""
_BENT_HOP: Final = 0.91
"""Neighbors in the bent part are at most this share of the radio's reach apart: less than elsewhere, because the
outermost are the fastest, and have the farthest way to their places."""
_AROUND: Final = 1.2
"""Lines that begin around the swarm do so at this share of the radio's reach from the middle at most: whoever is nearer
and was not found on the way out is found on the way back only."""
_STEPS: Final = 8
"""Lines to which the swarm would not stay together begin nearer, by one of so many steps each time."""
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
        gaps_m: tuple[float, ...] = (),
        joints: tuple[float, ...] = (),
    ) -> None:
        """`most_m`: the farthest innermost lines, and `gaps_m`: distances of lines from the north, that the relays left
        span; `joints`: the lane of each line at which chains end, by default the middle one.
        """
        self._formation = formation
        self._joints = joints or (formation.lanes // 2,) * formation.teams
        self._most_m = most_m
        self._half = half = formation.teams // 2
        self._apart_m = formation.last_m - formation.first_m
        straight_s = self._apart_m / formation.speed_m_s
        back_s = (formation.last_m - min(FIRST_M, formation.first_m)) / (BACK * formation.speed_m_s)
        """The time of the way back to the middle, and of the outermost lanes of bent lines from there."""
        self._sweep_s = max(straight_s, back_s) if _is_bent(formation) else straight_s
        self._faster_back = self._sweep_s / back_s
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
        return 2 * self._formation.half_width_m / (self._formation.lanes - 1)

    def at(self, place: float, swept_s: float) -> Enu:
        formation = self._formation
        lanes = formation.lanes
        if place <= formation.teams * lanes - 1:
            line, lane = divmod(place, lanes)
            inner_m = self._inner_m(swept_s, lane)
            return Enu(self._lane(lane), self._north_m(int(line), inner_m), formation.height_m)
        if place < formation.fixed:
            inner_m = self._inner_m(swept_s, lanes // 2)
            chain, row = next((c, row) for c, row in enumerate(self._chains) if place < row.first + row.size)
            share = 1 - 2 * (place - row.first + 1) / (row.size + 1)
            north, south = self._lane(self._joints[chain]), self._lane(self._joints[chain + 1])
            up_m, middle = formation.height_m + _CHAIN_HIGHER_M, (north + south + share * (north - south)) / 2
            if chain != self._half - 1:
                ends = self._north_m(chain, inner_m), self._north_m(chain + 1, inner_m)
                return Enu(middle, (sum(ends) + share * (ends[0] - ends[1])) / 2, up_m)
            begins_m = self._begins_m(swept_s, lanes // 2)
            bunched_m = _BUNCHED_M / 2 if begins_m > FIRST_M else _BUNCHED_M
            east = -bunched_m * share * max(0.0, 1 - (inner_m - begins_m) / _STRAIGHT_M)
            return Enu(middle + east, share * inner_m, up_m)
        line, share = formation.follower(round(place))
        outward_m, lane = self._outward_m[line], share * (lanes - 1)
        behind_m = FOLLOW_M if not outward_m else min(FOLLOW_M, self._apart_m / 2)
        behind = max(self._inner_m(swept_s, lane) + outward_m - behind_m, self._starts_m(lane) * 0.5)
        east = formation.half_width_m * (2 * share - 1)
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
        return at._replace(east=at.east + whole_m * min(1.0, formation.lanes - 1 - lane))

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
        half_width_m = min(formation.half_width_m, max(1, min(left[: formation.teams]) - 1) * hop_m / 2)
        joints = tuple(row.nearest(row.first + row.size // 2, vacant)[1] - row.first for row in lines)
        lane_m = 2 * half_width_m / (formation.lanes - 1)
        aside_m = [lane_m * (a - b) for a, b in itertools.pairwise(joints)]
        spans_m = [
            math.sqrt(max(0.0, ((count + 1) * hop_m) ** 2 - off_m**2))
            for count, off_m in zip(relays, aside_m, strict=True)
        ]
        gaps_m = tuple(min(self._apart_m, span_m) for span_m in spans_m)
        narrow = formation._replace(half_width_m=half_width_m)
        return Lines(narrow, most_m=spans_m[self._half - 1] / 2, gaps_m=gaps_m, joints=joints)

    def begun_around(self, swarm: Swarm) -> tuple[Dimensions, ...]:
        """Two lines that begin where the swarm stands or nearer, the farthest first; none unless it stands densely
        enough to hear everybody between, and widely enough for all lanes but the bent ones.
        """
        made = self._formation
        east_m, west_m, north_m, south_m = swarm.sides_m
        aside_m, beyond_m = min(east_m, west_m), min(north_m, south_m)
        if made.teams != 2 or made.lanes <= 2 * _BENT or beyond_m <= FIRST_M:
            return ()
        lane_m = 2 * made.half_width_m / (made.lanes - 1)
        is_dense = (east_m + west_m) * (north_m + south_m) <= swarm.uavs * (_DENSE * swarm.reach_m) ** 2
        if not is_dense or made.half_width_m - _BENT * lane_m > aside_m:
            return ()
        step_m = math.sqrt(max(0.0, (_BENT_HOP * swarm.reach_m) ** 2 - lane_m**2))
        most_m = max(made.first_m, min(beyond_m, made.last_m / 2, FIRST_M + _BENT * step_m, _AROUND * swarm.reach_m))
        shares = (step / _STEPS for step in range(_STEPS, 0, -1))
        return tuple(made._replace(first_m=made.first_m + share * (most_m - made.first_m)) for share in shares)

    def apart_m(self, team: int, east_m: float, north_m: float, swept_s: float) -> float:
        """The distance of a point from a line to the north or south; a line is taken to be as wide as the area."""
        last = self._formation.lanes - 1
        lane = max(0.0, min(1.0, (east_m / self._formation.half_width_m + 1) / 2)) * last
        return abs(north_m - self._north_m(team, self._inner_m(swept_s, lane)))

    def _inner_m(self, swept_s: float, lane: float) -> float:
        """How far from the middle the innermost lines are at a lane."""
        formation = self._formation
        if not _is_bent(formation):
            return min(self._most_m, swept_m(formation, swept_s))
        first_m = self._begins_m(swept_s, lane)
        flown = formation._replace(first_m=first_m, speed_m_s=(formation.last_m - first_m) / self.sweep_s)
        return min(self._most_m, swept_m(flown, swept_s, faster_back=self._faster_back))

    def _begins_m(self, swept_s: float, lane: float) -> float:
        return self._starts_m(lane) if swept_s <= self.sweep_s else min(FIRST_M, self._formation.first_m)

    def _starts_m(self, lane: float) -> float:
        first_m = self._formation.first_m
        if not _is_bent(self._formation):
            return first_m
        from_end = min(lane, self._formation.lanes - 1 - lane)
        return FIRST_M + min(1.0, from_end / _BENT) * (first_m - FIRST_M)

    def _north_m(self, line: int, inner_m: float) -> float:
        out_m = inner_m + self._outward_m[line]
        return out_m if line < self._half else -out_m

    def _lane(self, lane: float) -> float:
        return self._formation.half_width_m * (2 * lane / (self._formation.lanes - 1) - 1)


def _is_bent(formation: Dimensions) -> bool:
    """True for lines that begin around the swarm: others begin no farther from the middle than `FIRST_M`."""
    return formation.first_m > FIRST_M


def fitted(count: int, demands: Demands) -> Dimensions | None:
    """As many lines as can sweep a square area in one piece; None if they are too few for two. Those too few to reach
    `EDGE_M` turn where all beyond are heard, so much slower that more UAVs need no more time.
    """
    half = demands.area_m / 2
    side = min(_SIDE_M, half / 2)
    half_width = half - side
    lanes = max(_LEAST_LANES, math.ceil(2 * half_width / demands.apart_m(demands.reach_m)) + 1)
    near = min(EDGE_M, half / 2)
    swept = half - near - min(FIRST_M, (half - near) / 2)
    found: Dimensions | None = None
    for of_half, edge in itertools.product(range(1, count // (2 * lanes) + 1), (near, max(near, demands.edge_m))):
        if found is not None and found.teams == 2 * of_half:
            continue
        first = min(FIRST_M, (half - edge) / 2)
        speed_m_s = (half - edge - first) / swept * demands.speed_m_s
        apart = (half - edge - first) / of_half
        relays = _relays(2 * (first + apart), demands.hop_m) + 2 * (of_half - 1) * _relays(apart, demands.hop_m)
        followers = count - 2 * of_half * lanes - relays
        if followers < 0:
            continue
        if of_half == 1 or (apart >= _LEAST_APART_M and followers >= _FREE):
            found = Dimensions(
                lanes, relays, followers, half_width, first, first + apart, demands.height_m, speed_m_s,
                teams=2 * of_half,
            )  # fmt: skip
    return found


def _relays(gap_m: float, hop_m: float) -> int:
    """The number of relays that join two lines at this distance."""
    return max(0, math.ceil(gap_m / hop_m) - 1)
