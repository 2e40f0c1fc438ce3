"""The outcome of a search mission, from the trace: survivors confirmed, area covered, coherence and separation of the
swarm. `summary_figures.toml` defines each figure; positions are the true ones, once a second (`Posed`).
"""

import math
import statistics
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from agents.mission.finding.known_survivors import SAME_PLACE_M
from fanet_mw.scenario import Scenario
from fanet_mw.trace import (
    Approaching,
    Arrived,
    Collided,
    Confirmed,
    Detected,
    FlightModeChanged,
    KnownOnGround,
    Located,
    MissionModeChanged,
    PlacedAmong,
    PlacedInside,
    Posed,
    RadioFault,
    Record,
    Refuted,
)
from fanet_mw.units import Enu, S
from fanet_mw.wire.survivors import is_person
from sim.records.record_kinds import records_of
from sim.results.coherence import Coherence, coherence
from sim.results.links_over_time import Absentees, parts
from sim.results.parted_air import Extent, PartedAir, parted
from sim.world.arrays import Flags, Rows, Values
from sim.world.environment.layout import positions
from sim.world.environment.survivors import place
from sim.world.sensors.phone import REFERENCE_LOSS_DB

_HOMEWARD: Final = frozenset({"return", "done", "recall", "land"})
"""The mission modes of a UAV that has left the search."""
_WRECKED: Final = "fallen"
"""The flight mode of a UAV that has crashed."""
_RETURNING: Final = "return"
"""The flight mode of a UAV that its flight controller brings home."""
_CELL_M: Final = 25.0
"""The length of the sides of the cells in which the area is counted, or nearly: a whole number of them fits."""
_MOST_CELLS: Final = 2_000
"""Along a side: those of areas beyond 50 km are larger, or a million metres would take gigabytes."""
_MOST_DECADES: Final = 12.0
"""The greatest range of a phone's receiver is 10^12 m, farther than anything is apart; its square is a number."""
_NEARLY_ALL: Final = 0.95
"""The share of the area whose first instant is a figure (`covered_95_s`)."""
MISTAKEN_M: Final = 25.0
"""A confirmation farther than this from the survivor's true place counts as mistaken: somebody else was seen there."""


def mission(scenario: Scenario, records: Collection[Record]) -> dict[str, Any]:
    """The table `mission` of the summary."""
    truth = place(scenario)
    first: dict[int, int] = {}
    heard: dict[int, int] = {}
    found = Confirmations(truth)
    for record in records_of(records, Approaching, Confirmed, Refuted):
        if type(record) is Approaching:
            first.setdefault(record.node, record.t_ns)
        else:
            found.add(record)
    located: dict[int, int] = {}
    for first_known in records_of(records, Detected, Located):
        (heard if type(first_known) is Detected else located).setdefault(first_known.survivor, first_known.t_ns)
    right, mistaken = found.right(), found.mistaken()
    _, false_persons = found.persons()
    confirmed = [*right, *mistaken]
    found_ns = found.found_ns()
    waited = [survivor for survivor in found_ns if survivor in heard]
    return {
        "survivors": scenario.mission.survivors,
        "detected": len(heard),
        "approached": len({r.survivor for r in records_of(records, Approaching)}),
        "reached": len({r.survivor for r in records_of(records, Arrived)}),
        "confirmed": len(right),
        "mistaken": len(mistaken),
        "persons": len(found_ns),
        "persons_false": false_persons,
        "reopened": found.reopened,
        "time_to_confirm_s": sorted(round(one.t_ns / S, 3) for one in right),
        "inside": len({r.survivor for r in records_of(records, PlacedInside)}),
        "inside_error_m": _median(found.errors_m(records_of(records, PlacedInside))),
        "among": len({r.survivor for r in records_of(records, PlacedAmong)}),
        "among_error_m": _median(found.errors_m(records_of(records, PlacedAmong))),
        "wait_s": _waits([max(0, found_ns[survivor] - heard[survivor]) / S for survivor in waited]),
        "located_wait_s": _waits(
            [max(0, found_ns[survivor] - located.get(survivor, found_ns[survivor])) / S for survivor in waited]
        ),
        "post_knows_s": _known_after(_to_ground_s(right, records)),
        "uavs_approaching": len(first),
        "time_to_approach_s": sorted(round(t_ns / S, 3) for t_ns in first.values()),
        "localization_error_m": _median(found.errors_m(records_of(records, Approaching))),
        "confirmed_error_m": _median([found.error_m(one) for one in confirmed]),
        "collisions": sum(1 for _ in records_of(records, Collided)),
        **_flown(scenario, records),
    }


_Placed = Approaching | Confirmed | PlacedInside | PlacedAmong


class Confirmations:
    """The confirmations of survivors that hold after the records that were taken in."""

    def __init__(self, truth: Sequence[Enu]) -> None:
        """`truth`: the true places of the survivors, in the order of their ids."""
        self._truth = truth
        self._held: dict[int, list[Confirmed]] = {}
        """For each survivor, and each person without a phone, the confirmations that hold, in their order."""
        self._as_ns: dict[int, int] = {}
        """For each person without a phone who was first confirmed as a survivor with one: the instant of that
        confirmation, which was refuted later."""
        self.reopened = 0
        """The number of times that a confirmation was taken back."""

    def add(self, record: Record) -> None:
        """Take in a record; others than confirmations and refutations change nothing."""
        if type(record) is Confirmed and (1 <= record.survivor <= len(self._truth) or is_person(record.survivor)):
            self._held.setdefault(record.survivor, []).append(record)
        elif type(record) is Refuted and record.survivor in self._held:
            held = self._held[record.survivor]
            self._held[record.survivor] = left = left_by(record, held)
            if given_up := [one for one in held if one not in left]:
                self._keep_as_persons(record, since_ns=given_up[0].t_ns)
                self.reopened += not is_person(record.survivor)

    def _keep_as_persons(self, refuted: Refuted, *, since_ns: int) -> None:
        """Let a person without a phone whom a UAV reports at the instant and place of a refutation count as found since
        the confirmation that is refuted.
        """
        for number, finds in self._held.items():
            if is_person(number) and finds and finds[0].t_ns == refuted.t_ns and not left_by(refuted, finds):
                self._as_ns[number] = since_ns

    def error_m(self, placed: _Placed) -> float:
        """The distance of the stated place of a survivor from the true one."""
        at = self._truth[placed.survivor - 1]
        return math.hypot(at.east - placed.east_m, at.north - placed.north_m)

    def errors_m(self, placed: Iterable[_Placed]) -> list[float]:
        """The errors [m] of places of survivors that exist; any other number comes only from a forged message."""
        return [self.error_m(one) for one in placed if 1 <= one.survivor <= len(self._truth)]

    def right(self) -> list[Confirmed]:
        """The first confirmation of each survivor who was announced near the true place."""
        return [one for one in self._first() if self.error_m(one) <= MISTAKEN_M]

    def mistaken(self) -> list[Confirmed]:
        """The same for those who were announced far from it."""
        return [one for one in self._first() if self.error_m(one) > MISTAKEN_M]

    def persons(self) -> tuple[dict[int, Confirmed], int]:
        """The find of a person without a phone that belongs to each survivor, and the number of all other such finds:
        false ones, and further ones of the same survivor. Nearest pairs are matched first.
        """
        finds = {number: held[0] for number, held in sorted(self._held.items()) if held and is_person(number)}
        near = sorted(
            (apart_m, number, survivor)
            for number, find in finds.items()
            for survivor, at in enumerate(self._truth, start=1)
            if (apart_m := math.hypot(at.east - find.east_m, at.north - find.north_m)) <= MISTAKEN_M
        )
        of: dict[int, int] = {}
        for _, number, survivor in near:
            if survivor not in of and number not in of.values():
                of[survivor] = number
        return {survivor: finds[number] for survivor, number in of.items()}, len(finds) - len(of)

    def found_ns(self) -> dict[int, int]:
        """The instant at which each survivor was found: by phone, as a person without one, or first by mistake under
        the number of another survivor.
        """
        persons, _ = self.persons()
        found = {survivor: self._as_ns.get(find.survivor, find.t_ns) for survivor, find in persons.items()}
        for one in self.right():
            found[one.survivor] = min(one.t_ns, found.get(one.survivor, one.t_ns))
        return found

    def _first(self) -> list[Confirmed]:
        return [held[0] for survivor, held in self._held.items() if held and not is_person(survivor)]


def left_by(refuted: Refuted, held: Sequence[Confirmed]) -> list[Confirmed]:
    """The confirmations of a survivor that hold after a refutation, which takes back all at the same place."""
    at = (refuted.east_m, refuted.north_m)
    return [one for one in held if math.dist(at, (one.east_m, one.north_m)) > SAME_PLACE_M]


def _to_ground_s(right: Sequence[Confirmed], records: Collection[Record]) -> list[float]:
    """For each survivor of whom the post on the ground knows, how long after the confirmation it learned that."""
    learned: dict[int, list[int]] = {}
    for known in records_of(records, KnownOnGround):
        learned.setdefault(known.survivor, []).append(known.t_ns)
    since = [[t_ns - one.t_ns for t_ns in learned.get(one.survivor, ()) if t_ns >= one.t_ns] for one in right]
    return [min(waited_ns) / S for waited_ns in since if waited_ns]


def _known_after(values_s: list[float]) -> dict[str, float | None]:
    p95 = round(float(np.quantile(values_s, 0.95)), 3) if values_s else None
    return {"count": len(values_s), "p95": p95, **_waits(values_s)}


def _waits(values_s: list[float]) -> dict[str, float | None]:
    if not values_s:
        return {"p50": None, "max": None}
    return {"p50": round(statistics.median(values_s), 3), "max": round(max(values_s), 3)}


def _median(values: list[float]) -> float | None:
    return round(statistics.median(values), 1) if values else None


def _flown(scenario: Scenario, records: Iterable[Record]) -> dict[str, Any]:
    """The figures of where UAVs flew: coverage, coherence and separation; each None if the trace has no positions."""
    covered, photographed = CoveredCells(scenario), PhotographedCells(scenario)
    graphs: list[Coherence] = []
    by_distance: list[bool] = []
    ever_parted = False
    with_post: list[bool] = []
    range_m, reaches = scenario.radio.range_m, max(scenario.reaches.values(), default=1.0)
    post = np.array(positions(scenario)[-1]) if scenario.post is not None else None
    nearly_all_ns: int | None = None
    nearest: list[Values] = []
    for t_ns, at, nodes, searching, extents in _instants(scenario, records):
        apart = np.linalg.norm(at[:, None] - at[None], axis=2)
        those, ids = at[searching], nodes[searching]
        near = apart[np.ix_(searching, searching)] <= range_m
        linked = near & ~parted(extents, those, ids)
        graphs.append(coherence(linked))
        by_distance.append(not parts(near).any() if extents else graphs[-1].connected)
        ever_parted |= bool(extents)
        if post is not None:
            part = parts(linked)
            cut = parted(extents, np.vstack([those, post]), np.append(ids, scenario.node_count))[-1, :-1]
            heard = (np.linalg.norm(those - post, axis=1) <= range_m * reaches) & ~cut
            with_post.append(bool(np.isin(part, part[heard]).all()))
        if len(at) > 1:
            np.fill_diagonal(apart, math.inf)
            nearest.append(apart.min(axis=0))
        covered.add(at.tolist())
        photographed.add(at.tolist())
        if nearly_all_ns is None and covered.share >= _NEARLY_ALL:
            nearly_all_ns = t_ns
    return {
        "coverage": round(covered.share, 6) if graphs else None,
        "covered_95_s": None if nearly_all_ns is None else round(nearly_all_ns / S, 3),
        "photographed": round(photographed.share, 6) if graphs and scenario.sensors.camera_hz else None,
        "connected": round(statistics.fmean(graph.connected for graph in graphs), 6) if graphs else None,
        **({"connected_by_distance": round(statistics.fmean(by_distance), 6)} if ever_parted else {}),
        "post_connected": round(statistics.fmean(with_post), 6) if with_post else None,
        "biconnected": round(statistics.fmean(graph.biconnected for graph in graphs), 6) if graphs else None,
        "diameter": _usual([graph.diameter for graph in graphs]) if graphs else None,
        "cut_vertices": _usual([graph.cut_vertices for graph in graphs]) if graphs else None,
        "nearest_m": _spread(np.concatenate(nearest)) if nearest else None,
    }


def _spread(distances_m: Values) -> dict[str, float]:
    least, hundredth, median = np.quantile(distances_m, (0.0, 0.01, 0.5)).tolist()
    return {"least": round(least, 2), "p1": round(hundredth, 2), "p50": round(median, 2)}


def _usual(values: list[int]) -> dict[str, float]:
    return {"p50": statistics.median(values), "most": max(values)}


class _Instant(NamedTuple):
    """The swarm at one instant."""

    t_ns: int
    at: Rows
    """The positions of the UAVs whose programs run."""
    nodes: npt.NDArray[np.int64]
    """Their ids."""
    searching: Flags
    """True for those that search: on the air, not crashed, and not on the way home."""
    extents: tuple[Extent, ...]
    """The partitions and jammed areas in force."""


def _instants(scenario: Scenario, records: Iterable[Record]) -> Iterator[_Instant]:
    """The swarm at each instant of which the trace has positions."""
    absent, air = Absentees(), PartedAir(scenario.radio)
    extents = air.in_force
    wrecked: set[int] = set()
    homeward: set[int] = set()
    returning: set[int] = set()
    rows: list[tuple[float, float, float]] = []
    nodes: list[int] = []
    searching: list[bool] = []
    t_ns = 0

    def instant() -> _Instant:
        return _Instant(t_ns, np.array(rows), np.array(nodes), np.array(searching), extents)

    for record in records_of(records, *Absentees.KINDS, MissionModeChanged, FlightModeChanged, Posed):
        if type(record) is FlightModeChanged:
            wrecked |= {record.node} if record.mode == _WRECKED else set()
            returning = returning | {record.node} if record.mode == _RETURNING else returning - {record.node}
        elif type(record) is MissionModeChanged:
            homeward = homeward | {record.node} if record.mode in _HOMEWARD else homeward - {record.node}
        elif type(record) is Posed:
            if record.t_ns != t_ns and rows:
                yield instant()
                rows, nodes, searching = [], [], []
            t_ns, extents = record.t_ns, air.in_force
            if record.node not in absent.dead:
                rows.append((record.east_m, record.north_m, record.up_m))
                nodes.append(record.node)
                searching.append(record.node not in homeward | wrecked | returning | absent.off_air)
        else:
            absent.take(record)
            if type(record) is RadioFault:
                air.take(record)
    if rows:
        yield instant()


class _Cells:
    """Cells of the area, none of them seen at first."""

    def __init__(self, scenario: Scenario) -> None:
        half = scenario.world.area_m / 2
        count = min(_MOST_CELLS, max(1, round(2 * half / _CELL_M)))
        self._axis = (np.arange(count) + 0.5) * (2 * half / count) - half
        self._seen = np.zeros((count, count), bool)

    @property
    def share(self) -> float:
        return float(self._seen.mean())

    @property
    def seen(self) -> Flags:
        """The cells, row by row from south to north, each row from west to east; true of those seen."""
        return self._seen.copy()


class CoveredCells(_Cells):
    """The cells of the area whose middle has come within the nominal range of a phone's receiver."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        mission = scenario.mission
        budget_db = mission.phone_power_dbm - mission.rubble_db - REFERENCE_LOSS_DB - mission.detection_dbm
        self._range_m = 10 ** min(_MOST_DECADES, budget_db / (10 * mission.phone_exponent))

    def add(self, at: Iterable[tuple[float, float, float]]) -> None:
        """UAVs were at these places."""
        for east, north, up in at:
            ground2 = self._range_m**2 - up**2
            if ground2 <= 0:
                continue
            near_e = np.flatnonzero(np.abs(self._axis - east) <= math.sqrt(ground2))
            near_n = np.flatnonzero(np.abs(self._axis - north) <= math.sqrt(ground2))
            within = (self._axis[near_n, None] - north) ** 2 + (self._axis[None, near_e] - east) ** 2 <= ground2
            self._seen[np.ix_(near_n, near_e)] |= within


def covered_over_time(scenario: Scenario, tracks: Iterable[Iterable[Posed]]) -> Iterator[tuple[int, CoveredCells]]:
    """Each instant of the UAVs' tracks, with the cells that they have covered by then; the cells are always the same
    object.
    """
    cells = CoveredCells(scenario)
    posed = sorted((one for track in tracks for one in track), key=lambda one: one.t_ns)
    for t_ns, together in groupby(posed, key=lambda one: one.t_ns):
        cells.add([(one.east_m, one.north_m, one.up_m) for one in together])
        yield t_ns, cells


class PhotographedCells(_Cells):
    """The cells of the area that cameras have shown: the middle of a cell was in the image."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._tan_east, self._tan_north = scenario.sensors.tan_half_fov
        self._most_up_m = scenario.nodes.altitude_m

    def add(self, at: Iterable[tuple[float, float, float]]) -> None:
        """UAVs were at these places; over hills they are taken to be at the height of the search."""
        for east, north, up in at:
            above_m = min(up, self._most_up_m)
            near_e = np.flatnonzero(np.abs(self._axis - east) <= above_m * self._tan_east)
            near_n = np.flatnonzero(np.abs(self._axis - north) <= above_m * self._tan_north)
            self._seen[np.ix_(near_n, near_e)] = True


UNHEARD: Final = "not heard"
"""The status of a survivor whose phone nobody has received yet."""
_STAGES: Final[Mapping[type[Any], str]] = {
    Detected: "detected", Approaching: "approached", Arrived: "reached", PlacedInside: "inside", PlacedAmong: "among",
}  # fmt: skip
"""The status to which a record of each type leads."""
_ORDER: Final = (UNHEARD, *_STAGES.values())
"""These statuses, from the first to the last; a survivor does not go back from a later one to an earlier one."""


class SurvivorState(NamedTuple):
    """The state of one survivor from an instant on."""

    t_ns: int
    status: str
    """`not heard`, `detected`: a phone was received, `approached`, `reached`, or `confirmed`; `inside`: said to be in a
    building; `among`: said to be one of several people; `mistaken`: confirmed far from the true place; `reopened`: the
    confirmation was taken back.
    """
    node: int
    """The UAV that brought this about; 0 if there was none."""


class SurvivorStates:
    """The states of all survivors, after the records that were taken in."""

    def __init__(self, truth: Sequence[Enu]) -> None:
        """`truth`: the true places of the survivors, in the order of their ids."""
        self.now = {survivor: SurvivorState(0, UNHEARD, 0) for survivor in range(1, len(truth) + 1)}
        self._held = Confirmations(truth)

    def take(self, record: Record) -> tuple[int, SurvivorState] | None:
        """Take in a record; returns the survivor and the new state, if it changes one."""
        if not isinstance(record, Detected | Approaching | Arrived | PlacedInside | PlacedAmong | Confirmed | Refuted):
            return None
        if record.survivor not in self.now:
            return None
        self._held.add(record)
        before = self.now[record.survivor].status
        status = self._status(record, before)
        if status == before:
            return None
        state = SurvivorState(record.t_ns, status, record.node)
        self.now[record.survivor] = state
        return record.survivor, state

    def count(self, status: str) -> int:
        return sum(state.status == status for state in self.now.values())

    def _status(self, record: Record, before: str) -> str:
        """The status of the survivor of a record, who had the status `before`."""
        if isinstance(record, Confirmed | Refuted):
            if record.survivor in {one.survivor for one in self._held.right()}:
                return "confirmed"
            if record.survivor in {one.survivor for one in self._held.mistaken()}:
                return "mistaken"
            return "reopened" if before in ("confirmed", "mistaken") else before
        stage = _STAGES[type(record)]
        return stage if before in _ORDER and _ORDER.index(stage) > _ORDER.index(before) else before
