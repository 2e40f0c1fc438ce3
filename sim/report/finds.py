"""What an incident commander asks of a search: who was found, where, how sure, when, and what is not searched yet.

The rows are what the swarm itself said (finds in its telemetry and trace). Only the last column and the count of those
nobody has found need the truth, which a simulation knows.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from agents.mission.finding.carriers import RAYLEIGH_95
from agents.mission.finding.known_survivors import SAME_PLACE_M
from fanet_mw.errors import MalformedFrameError
from fanet_mw.geodesy import Geodetic, to_geodetic
from fanet_mw.trace import Approaching, Confirmed, Detected, PlacedAmong, PlacedInside, Refuted
from fanet_mw.units import US, Enu, S
from fanet_mw.wire import FOUND
from fanet_mw.wire.frame import Content, message_id
from fanet_mw.wire.survivors import Found, Standing, is_person
from sim.report.html import Rows
from sim.report.run_records import RunRecords
from sim.report.run_rows import number, percent
from sim.results.mission import CoveredCells, left_by
from sim.results.run_folder import RunFolder

_INSIDE: Final = "inside a building"
_AMONG: Final = "one of the people there"
_STANDING: Final = {"confirmed": Standing.CONFIRMED, _INSIDE: Standing.INSIDE, _AMONG: Standing.AMONG}
_MOST_PIECES: Final = 5
_M2_PER_HA: Final = 10_000.0


class Find(NamedTuple):
    """What the swarm knew of one survivor at the end."""

    survivor: int
    said: str
    at: tuple[float, float] | None
    """East and north [m]; None if nobody said where."""
    heard_ns: int | None
    said_ns: int
    node: int
    sigma_m: float | None = None
    """The standard deviation of the place in its worst direction, as it was told; None: nobody told it."""


class Piece(NamedTuple):
    """A connected piece of the area that was not searched."""

    area_m2: float
    west: float
    south: float
    east: float
    north: float


def finds(run: RunRecords) -> list[Find]:
    """The last word about each survivor of whom the swarm knew, those confirmed first, by the time of that word."""
    heard: dict[int, int] = {}
    words: dict[int, Find] = {}
    confirmed: dict[int, list[Confirmed]] = {}
    for record in run.mission:
        survivor = record.survivor
        match record:
            case Detected():
                heard.setdefault(survivor, record.t_ns)
                words.setdefault(survivor, Find(survivor, "heard", None, None, record.t_ns, record.node))
            case Approaching() if survivor not in confirmed:
                at = (record.east_m, record.north_m)
                words[survivor] = Find(survivor, "estimated", at, None, record.t_ns, record.node)
            case PlacedInside() | PlacedAmong() if survivor not in confirmed:
                said = _INSIDE if isinstance(record, PlacedInside) else _AMONG
                at = (record.east_m, record.north_m)
                words[survivor] = Find(survivor, said, at, None, record.t_ns, record.node)
            case Confirmed():
                held = confirmed.setdefault(survivor, [])
                held.append(record)
                words[survivor] = _seen(held[0])
            case Refuted() if survivor in confirmed:
                held = left_by(record, confirmed[survivor])
                at = (record.east_m, record.north_m)
                words[survivor] = (
                    _seen(held[0]) if held else Find(survivor, "taken back", at, None, record.t_ns, record.node)
                )
                if held:
                    confirmed[survivor] = held
                else:
                    del confirmed[survivor]
    found = [one._replace(heard_ns=heard.get(survivor)) for survivor, one in words.items()]
    return sorted(found, key=lambda one: (one.said != "confirmed", one.said_ns))


def _seen(record: Confirmed) -> Find:
    at = (record.east_m, record.north_m)
    return Find(record.survivor, "confirmed", at, None, record.t_ns, record.node)


def told(folder: RunFolder) -> Mapping[tuple[int, Standing], Found]:
    """The last estimate and the last confirmation of each survivor that UAVs told each other, by the telemetry log."""
    latest: dict[tuple[int, Standing], Found] = {}
    for _, frame in folder.telemetry():
        if message_id(frame) == FOUND.msgid:
            try:
                found = Found.decode_frame(Content(((FOUND.msgid, frame),)))
            except MalformedFrameError:
                continue  # of a foreign program
            key = (found.survivor, found.standing)
            if key not in latest or found.t_us >= latest[key].t_us:
                latest[key] = found
    return latest


def with_estimates(known: Sequence[Find], said: Mapping[tuple[int, Standing], Found]) -> list[Find]:
    """The finds with the better place and the uncertainty that UAVs told each other."""
    better = []
    for one in known:
        standing = _STANDING.get(one.said, Standing.ESTIMATED)
        found = said.get((one.survivor, standing))
        if found is not None and standing is not Standing.ESTIMATED:
            one = one._replace(sigma_m=found.sigma_m)
        elif found is not None and one.said in ("heard", "estimated"):
            place = (found.east_m, found.north_m)
            one = one._replace(
                said="estimated", at=place, said_ns=found.t_us * US, node=found.node, sigma_m=found.sigma_m
            )
        better.append(one)
    return better


def without_doubles(known: Sequence[Find]) -> tuple[list[Find], int]:
    """The finds without persons at a place where a survivor is confirmed; and how many those are."""
    places = [one.at for one in known if one.at is not None and one.said == "confirmed" and not is_person(one.survivor)]

    def double(one: Find) -> bool:
        return (
            is_person(one.survivor)
            and one.at is not None
            and any(math.dist(one.at, place) <= SAME_PLACE_M for place in places)
        )

    kept = [one for one in known if not double(one)]
    return kept, len(known) - len(kept)


def found_rows(run: RunRecords, known: Sequence[Find]) -> Rows:
    sensors, world = run.scenario.sensors, run.scenario.world
    origin = Geodetic(*world.origin_deg, 0.0)
    gps_m = math.hypot(sensors.gps_common_m, sensors.gps_bias_m, world.gps_sigma_m)
    rows = []
    for one in known:
        who = "person without a phone" if is_person(one.survivor) else f"survivor {one.survivor}"
        place, on_earth, off = "-", "-", "-"
        if one.at is not None:
            east, north = one.at
            at = to_geodetic(Enu(east, north, 0.0), origin)
            place = f"{abs(east):.0f} {'E' if east >= 0 else 'W'}, {abs(north):.0f} {'N' if north >= 0 else 'S'}"
            on_earth = f"{at.lat_deg:.6f}, {at.lon_deg:.6f}"
            if 1 <= one.survivor <= len(run.survivors):
                truth = run.survivors[one.survivor - 1]
                off = f"{math.hypot(truth.east - east, truth.north - north):.0f} m"
        rows.append([who, place, on_earth, _how_sure(one, gps_m), _seconds(one.heard_ns),
                     _seconds(one.said_ns), f"UAV {one.node}", off])  # fmt: skip
    return Rows(("who", "where [m]", "latitude, longitude", "how sure", "heard", "said", "by", "truly off by"), rows)


def _how_sure(one: Find, gps_m: float) -> str:
    """What UAVs told each other of a place counts from where they are: the error of their own places comes on top."""
    words = {
        "confirmed": "confirmed at close range", "heard": "phone heard, no place yet",
        "taken back": "confirmation taken back", "estimated": "by phone alone",
    }  # fmt: skip
    said = words.get(one.said, one.said)
    if one.sigma_m is not None:
        return f"{said}, within {max(1.0, RAYLEIGH_95 * math.hypot(one.sigma_m, gps_m)):.0f} m (95 %)"
    return f"{said}, roughly" if one.said == "estimated" else said


def _seconds(t_ns: int | None) -> str:
    return "-" if t_ns is None else f"{t_ns / S:.0f} s"


def unsearched(run: RunRecords) -> tuple[float, list[Piece]]:
    """The share of the area that no UAV has searched, and its connected pieces, the largest first."""
    cells = CoveredCells(run.scenario)
    cells.add(run.flown())
    missing = ~cells.seen
    half, count = run.scenario.world.area_m / 2, len(missing)
    side = 2 * half / count
    pieces = []
    left = {(int(row), int(column)) for row, column in zip(*missing.nonzero(), strict=True)}
    while left:
        piece, edge = set[tuple[int, int]](), [left.pop()]
        while edge:
            row, column = edge.pop()
            piece.add((row, column))
            beside = {(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)} & left
            left -= beside
            edge.extend(beside)
        rows, columns = [row for row, _ in piece], [column for _, column in piece]
        pieces.append(
            Piece(
                len(piece) * side**2, min(columns) * side - half, min(rows) * side - half,
                (max(columns) + 1) * side - half, (max(rows) + 1) * side - half,
            )
        )  # fmt: skip
    return float(missing.mean()), sorted(pieces, key=lambda piece: (-piece.area_m2, piece.west, piece.south))


def unsearched_rows(share: float, pieces: Sequence[Piece]) -> Rows:
    rows = [
        [f"{piece.area_m2 / _M2_PER_HA:.1f} ha", f"{piece.west:.0f} to {piece.east:.0f}",
         f"{piece.south:.0f} to {piece.north:.0f}"]
        for piece in pieces[:_MOST_PIECES]
    ]  # fmt: skip
    more = len(pieces) - _MOST_PIECES
    if more > 0:
        rest = sum(piece.area_m2 for piece in pieces[_MOST_PIECES:]) / _M2_PER_HA
        rows.append([f"{number(round(rest, 1))} ha", f"in {more} smaller pieces", ""])
    return Rows((f"not searched: {percent(share)}", "east [m]", "north [m]"), rows)


def missed_sentence(run: RunRecords, known: Sequence[Find], doubles: int) -> str:
    """Who was not found, which only a simulation can say, and which finds are left out."""
    named = {one.survivor for one in known}
    missed = [survivor for survivor in range(1, len(run.survivors) + 1) if survivor not in named]
    people = f"{len(missed)} of {len(run.survivors)}: {', '.join(map(str, missed))}"
    said = f"Nobody has heard of {people}." if missed else f"The swarm knew of all {len(run.survivors)}."
    if doubles:
        said += f" Left out are {doubles} finds of persons without a phone, at places where a survivor is confirmed."
    return f"{said} Whom it missed, and how far a place is off, is known only in a simulation."
