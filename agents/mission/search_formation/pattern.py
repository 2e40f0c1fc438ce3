"""The formation of a search: its shape and its dimensions together, and the formation that fits a number of UAVs.

The words place, team, lane, relay and follower are explained in `shapes/contract.py`.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import pairwise
from typing import Final, assert_never

from agents.mission.search_formation.shapes import circuit, fan, lines, ring, sectors, spiral
from agents.mission.search_formation.shapes.circuit import Circuit
from agents.mission.search_formation.shapes.contract import Demands, Dimensions, RowOfPlaces, Shape, ShapeName, swarm_at
from agents.mission.search_formation.shapes.fan import Fan
from agents.mission.search_formation.shapes.lines import Lines
from agents.mission.search_formation.shapes.ring import Ring
from agents.mission.search_formation.shapes.sectors import Sectors
from agents.mission.search_formation.shapes.spiral import Spiral
from fanet_mw.graph.topology import levels
from fanet_mw.units import STILL, Enu
from fanet_mw.wire.search_plan import MOST_PLACES

_SHAPES: Final[Mapping[ShapeName, Callable[[Dimensions], Shape]]] = {
    ShapeName.LINES: Lines,
    ShapeName.SPIRAL: Spiral,
    ShapeName.SECTORS: Sectors,
    ShapeName.RING: Ring,
    ShapeName.CIRCUIT: Circuit,
    ShapeName.FAN: Fan,
}
_STEP_S: Final = 0.05
"""The time step over which the velocity of a place is computed."""


_HOP: Final = 0.91
"""Neighbors in a row that has closed ranks are at most this share of the radio's reach apart: with 0.93 a chain at its
longest came apart for seconds, because its relays follow each other."""
_LEAVES: Final = 0.93
"""Every second UAV of a row may leave while those beside it are at most this share of the reach apart."""


class Pattern:
    """A formation, and the position of each of its places over time."""

    def __init__(self, dimensions: Dimensions, *, reach_m: float, vacant: frozenset[int] = frozenset()) -> None:
        """`vacant`: the places without a UAV, over which the others of their rows close ranks. `reach_m`: of radios."""
        self.dimensions = dimensions
        self.vacant = vacant
        whole = self._whole = _SHAPES[dimensions.shape](dimensions)
        self.reach_m, self._hop_m = reach_m, _HOP * reach_m
        self._rows = whole.rows()
        self._flown = {place: at for row in self._rows for place, at in row.shared(vacant).items()}
        """Where on its row each UAV flies whose row has closed ranks, by its place (`RowOfPlaces.shared`)."""
        self.shape: Shape = whole.drawn_in(vacant, self._hop_m) if vacant else whole
        self._begins: dict[int, Enu] = {}
        """Where the sweep begins for those places that were asked for; until it begins that is asked all the time."""
        self._ties: dict[int, list[int]] = {}
        """What `_tied_to` has returned for each place."""

    def closed(self, vacant: frozenset[int]) -> "Pattern":
        """The same formation without the UAVs of these places."""
        return Pattern(self.dimensions, reach_m=self.reach_m, vacant=vacant)

    def begun_around(self, positions: Sequence[Enu]) -> "list[Pattern]":
        """The formations in which a swarm that stands there may begin, the fastest first."""
        begun = self._whole.begun_around(swarm_at(positions, reach_m=self.reach_m))
        return [Pattern(dimensions, reach_m=self.reach_m) for dimensions in begun] or [self]

    def spans(self, vacant: frozenset[int]) -> bool:
        """True if the UAVs of the other places can sweep all that this formation sweeps."""
        if self.dimensions.shape is ShapeName.CIRCUIT or not vacant:
            return True
        closed, whole, end_s = self.closed(vacant), _SHAPES[self.dimensions.shape](self.dimensions), self.shape.sweep_s
        for row in whole.rows():
            if any(closed.shape.at(end, end_s) != whole.at(end, end_s) for end in {row.places[0], row.places[-1]}):
                return False
            shared = row.shared(vacant)
            flown = [whole.at(shared.get(place, place), end_s) for place in row.places if place not in vacant]
            if not flown or any(a.horizontal_to(b) > self._hop_m for a, b in pairwise(flown)):
                return False
        return True

    @property
    def places(self) -> int:
        """The number of places: team by team, then relays, then followers."""
        return self.dimensions.places

    @property
    def followers(self) -> range:
        """The places without which the swarm stays connected."""
        return range(self.dimensions.fixed, self.dimensions.places)

    def line(self, place: int) -> range:
        """The places of the team of a place, lane by lane."""
        return self.dimensions.line(self.dimensions.team_of(place))

    def kind(self, place: int) -> str:
        """The kind of a place: `line` for one of any team, `relay` or `follower`."""
        if place < self.dimensions.fixed - self.dimensions.relays:
            return "line"
        return "relay" if place < self.dimensions.fixed else "follower"

    def at(self, place: int, swept_s: float) -> Enu:
        """The position of a place after this time of sweeping; before 0, where the sweep begins."""
        if swept_s > 0:
            return self.shape.flown_at(self._flown.get(place, place), swept_s)
        begins = self._begins.get(place)
        if begins is None:
            begins = self._begins[place] = self.shape.flown_at(self._flown.get(place, place), 0.0)
        return begins

    def has_beside(self, place: int, others: frozenset[int]) -> bool:
        """True if one of these places is in the row of a place, or in a row that ends there."""
        beside = {place, *self._whole.tethers(place)}
        return any(others.intersection(row.places) and beside.intersection(row.places) for row in self._rows)

    def gap_beside(self, place: int, lost: frozenset[int]) -> tuple[int, bool]:
        """How many UAVs are lost in the gap nearest to a place in its row, 0 without one; and True if that gap is at
        higher places.
        """
        row = self._row(place)
        gap = min((other for other in lost if row and other in row.places), key=lambda o: abs(o - place), default=None)
        if gap is None:
            return 0, False
        way, size = (1 if gap > place else -1), 1
        while gap + way * size in lost:
            size += 1
        return size, gap > place

    def hops_from(self, gap: Collection[int]) -> dict[int, int]:
        """How many ties lead from each place to the nearest of these; a place that none leads to is not in it."""
        return levels({place: self._whole.tethers(place) for place in range(self.places)}, *gap)

    def _tied_to(self, place: int) -> list[int]:
        """The places to which a place is tied, vacant ones, too. Where another row ends at a place of its row, the UAV
        that flies nearest to that place is tied to it.
        """
        whole = self._whole
        row = self._row(place)
        if row is None or not self.vacant:
            return list(whole.tethers(place))
        found = [other for other in whole.tethers(place) if other in row.places]
        for end in row.places:
            if row.nearest(end, self.vacant)[0] == place:
                found += [self._nearest(other) for other in whole.tethers(end) if other not in row.places]
        return found

    def _row(self, place: int) -> RowOfPlaces | None:
        return next((row for row in self._rows if place in row.places), None)

    def _nearest(self, place: int) -> int:
        """The place whose UAV flies nearest to a place of its row, now that the row has closed ranks."""
        row = self._row(place)
        return place if row is None else row.nearest(place, self.vacant)[0]

    def tethers(self, place: int, swept_s: float) -> tuple[int, ...]:
        """The places that must stay in reach of this one; instead of one that is vacant or may be left, those beyond.
        None for a follower.
        """
        found: set[int] = set()
        passed, waiting = {place}, [place]
        while waiting:
            tied = waiting.pop()
            if tied not in self._ties:
                self._ties[tied] = self._tied_to(tied)
            for other in self._ties[tied]:
                if other not in passed:
                    passed.add(other)
                    passes = other in self.vacant or self.may_leave(other, swept_s)
                    (waiting.append if passes else found.add)(other)
        return tuple(sorted(found))

    def may_leave(self, place: int, swept_s: float) -> bool:
        """True for a place that may be left now: a follower's, and many of a ring that is small."""
        if self.kind(place) == "follower":
            return True
        rank = place - sum(other < place for other in self.vacant)
        if rank % 2 == 0:
            return False
        at, left = self._flown.get(place, place), self._rows[0].left(self.vacant)
        return self.shape.may_leave(at, swept_s, reach_m=_LEAVES * self.reach_m, left=left)

    def velocity(self, place: int, swept_s: float) -> Enu:
        """The velocity of a place, without its shifts between lanes, during which all wait at the edge of the area."""
        if swept_s < 0:
            return STILL
        early = max(0.0, swept_s - _STEP_S)
        flown = self._flown.get(place, place)
        a, b = self.shape.at(flown, early), self.shape.at(flown, early + _STEP_S)
        return Enu((b.east - a.east) / _STEP_S, (b.north - a.north) / _STEP_S, (b.up - a.up) / _STEP_S)


def fastest(count: int, demands: Demands) -> Pattern | None:
    """The formation of the fastest sweep; None if they are too few for any. Surplus UAVs become followers."""
    count = min(count, MOST_PLACES)
    found = [
        lines.fitted(count, demands),
        circuit.fitted(count, demands),
        spiral.fitted(count, demands),
        *(sectors.fitted(count, teams, demands) for teams in range(1, count + 1)),
    ]
    patterns = [Pattern(made, reach_m=demands.reach_m) for made in found if made is not None]
    return min(patterns, key=lambda pattern: pattern.shape.sweep_s, default=None)


def of_few(count: int, demands: Demands, *, connected: bool = True) -> Pattern:
    """The fastest formation of so many UAVs: lines, one line abreast, or a spiral; if it need not be `connected` also a
    circuit, in which nobody keeps in reach of others.
    """
    count = min(count, MOST_PLACES)
    found = [lines.fitted(count, demands), sectors.fitted(count, 1, demands), spiral.fitted(count, demands)]
    found += [] if connected else [circuit.fitted(count, demands)]
    patterns = [Pattern(made, reach_m=demands.reach_m) for made in found if made is not None]
    return min(patterns, key=lambda pattern: pattern.shape.sweep_s)


def fitted(
    count: int, demands: Demands, *, shape: ShapeName = ShapeName.LINES, sectors_wanted: int = 1
) -> Pattern | None:
    """The formation of a shape; None if they are too few. UAVs beyond the room of a plan message get no place."""
    count = min(count, MOST_PLACES)
    match shape:
        case ShapeName.LINES:
            made = _lines(count, demands)
        case ShapeName.SPIRAL:
            made = spiral.fitted(count, demands)
        case ShapeName.SECTORS:
            made = sectors.fitted(count, sectors_wanted, demands)
        case ShapeName.RING:
            made = ring.fitted(count, demands) or _lines(count, demands)
        case ShapeName.CIRCUIT:
            made = circuit.fitted(count, demands)
        case ShapeName.FAN:
            made = fan.fitted(count, demands) or _lines(count, demands)
        case _:
            assert_never(shape)
    return None if made is None else Pattern(made, reach_m=demands.reach_m)


def _lines(count: int, demands: Demands) -> Dimensions | None:
    """Two lines or more, or one line abreast over the whole area."""
    return lines.fitted(count, demands) or sectors.fitted(count, 1, demands)
