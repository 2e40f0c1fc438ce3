#!/usr/bin/env python
"""Part the air of one search for 20 s along drawn lines: `python scripts/partitions.py SEED COUNT`.

At each drawn instant the process forks, and the copy flies on for 45 s. With `--processes` each is a launch of its own,
one process per UAV, in which the programs of `--kill` drawn UAVs are killed 2 to 10 s after the cut, and started again
3 s later; an application beside the search writes into the trace who plans, and who knows whom. One JSON line for each:

    parts    the sizes of the parts while the air is parted, and how many planners each has 3, 5, 10 and 19 s later
    crossed  how many have flown over the line within the 3 s before that: their new part hardly knows them yet
    wrong    all stretches, from when until when after the cut, in which some part had no planner or several [s]
    merged   the same 1, 2, 3, 5 and 8 s after the air is whole again: who has closed ranks may be out of reach still
    unknown  to how many a find that anybody knew then is unknown: just before, and 1, 2, 3, 5 and 8 s after
    least_m  the least distance of two UAVs from the cut on

and, of a launch, when whose program was killed [s], whether the run is valid, and at which pace its clock ran.
"""

# ruff: noqa: SLF001  (what a UAV knows, and whether it plans, nobody is told)
import argparse
import json
import math
import os
import random
import subprocess
import sys
import tempfile
from abc import abstractmethod
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from agents.mission.applications import PlannedSearch  # noqa: E402  (the tree's root is on the path now)
from agents.mission.searcher import Searcher  # noqa: E402
from agents.uav import Uav  # noqa: E402
from fanet_mw.bus.radio_control import PARTITION_LABEL, Partition  # noqa: E402
from fanet_mw.scenario import Scenario  # noqa: E402
from fanet_mw.trace import MissionModeChanged, Posed, Record, parse  # noqa: E402
from fanet_mw.units import S  # noqa: E402
from scripts.losses import Flight, Instant, stretches  # noqa: E402
from scripts.search_witness import FOLLOWS, FORGETS, KNOWS, PLANS, STARTS, known, plans  # noqa: E402
from sim.records.record_kinds import records_of  # noqa: E402
from sim.results.file_names import SUMMARY_FILE, TRACE_FILE  # noqa: E402
from sim.results.links_over_time import parts  # noqa: E402
from sim.run.virtual import GARBAGE, StoppableUav  # noqa: E402
from sim.scenarios.catalog import find  # noqa: E402

_FOR_S: Final = 20.0
_ON_S: Final = 45.0
_FROM_S: Final = 60.0
_UNTIL: Final = 0.75
_FAR_M: Final = 2000.0
_ASIDE_M: Final = 500.0
"""The greatest distance of a line from the middle of an area of `_WHOLE_M`."""
_WHOLE_M: Final = 2500.0
_LOOKS_S: Final = 0.5
_SHOWN_S: Final = (3, 5, 10, 19)
_KILLED_S: Final = (2.0, 10.0)
_STARTED_S: Final = 3.0
_SLOWEST: Final = 0.1
"""The pace to which the clock of a launch may slow down on a busy machine."""
_ENDS: Final = "ends"
"""A UAV's program is killed."""


class Line(NamedTuple):
    """A line on the map, so far from the middle, at right angles to this direction."""

    angle: float
    off_m: float

    @property
    def normal(self) -> npt.NDArray[np.float64]:
        return np.array([math.cos(self.angle), math.sin(self.angle)])

    @property
    def ends(self) -> tuple[float, float, float, float]:
        """Two points of it, each east and north."""
        (east, north), along = (
            self.off_m * self.normal,
            _FAR_M * np.array([-math.sin(self.angle), math.cos(self.angle)]),
        )
        return (east - along[0], north - along[1], east + along[0], north + along[1])


class Cut(NamedTuple):
    """When and where the air is parted."""

    at_s: float
    line: Line


class Killed(NamedTuple):
    """Whose program is killed when."""

    at_s: float
    node: int


class Parted:
    """A swarm whose air is parted along a line, at one instant after the other."""

    line: Line
    scenario: Scenario
    _instants: list[Instant]

    @abstractmethod
    def advance(self, until_ns: int) -> None:
        """Look at this instant from now on."""

    @abstractmethod
    def planning(self) -> set[int]:
        """The UAVs that take themselves for planners."""

    @abstractmethod
    def finds(self) -> dict[int, set[int]]:
        """Whom each UAV knows to be confirmed."""

    def stopped(self) -> set[int]:
        """The UAVs whose program does not run: they neither plan nor relay."""
        return set()

    def planners(self, *, cut: bool) -> list[tuple[int, int]]:
        """The size of each part, and how many in it take themselves for its planner."""
        _, ids, at = self._instants[-1]
        lives = ~np.isin(ids, list(self.stopped()))
        ids, at = ids[lives], at[lives]
        near = np.linalg.norm(at[:, None] - at[None], axis=2) <= self.scenario.radio.range_m
        side = np.array(self._is_beyond(at))
        part, leads = parts(near & (side[:, None] == side[None]) if cut else near), self.planning()
        members = [set(ids[part == one].tolist()) for one in set(part.tolist())]
        return sorted(((len(each), len(leads & each)) for each in members), reverse=True)

    def crossed(self) -> int:
        """How many UAVs are on the other side of the line than 3 s ago."""
        now = self._instants[-1]
        before = next(one for one in reversed(self._instants) if one.t_ns <= now.t_ns - 3 * S)
        there = dict(zip(before.ids.tolist(), self._is_beyond(before.at), strict=True))
        here = zip(now.ids.tolist(), self._is_beyond(now.at), strict=True)
        return sum(there[node] != is_beyond for node, is_beyond in here if node in there)

    def _is_beyond(self, at: npt.NDArray[np.float64]) -> list[bool]:
        return [bool(beyond) for beyond in at[:, :2] @ self.line.normal > self.line.off_m]

    def least_m(self, from_ns: int) -> float:
        apart = [np.linalg.norm(at[:, None] - at[None], axis=2) for t_ns, _, at in self._instants if t_ns >= from_ns]
        return round(float(min((one + np.diag(np.full(len(one), np.inf))).min() for one in apart)), 1)


class Forked(Flight, Parted):
    """A flight in this process, whose air is parted now."""

    def part(self, line: Line) -> None:
        self.line = line
        self.host.put(self._topics.radio_control, Partition(PARTITION_LABEL, (), line.ends, round(_FOR_S * S)))

    def advance(self, until_ns: int) -> None:
        self.host.run(until_ns)

    def searches(self) -> dict[int, Searcher]:
        """The search on board of each UAV; what it knows is not told to anybody, so this looks inside."""
        found = {}
        for actor in self._actors:
            uav = actor.alive if isinstance(actor, StoppableUav) else actor
            if isinstance(uav, Uav):
                applications = uav._onboard._applications
                found[int(uav._node.node)] = next(a._searcher for a in applications if isinstance(a, PlannedSearch))
        return found

    def planning(self) -> set[int]:
        return {node for node, search in self.searches().items() if plans(search, self.host.now_ns)}

    def finds(self) -> dict[int, set[int]]:
        return {node: known(search) for node, search in self.searches().items()}


class Recorded(Parted):
    """A flight that is over, by its trace."""

    def __init__(self, scenario: Scenario, records: Sequence[Record], cut: Cut, killed: Sequence[Killed]) -> None:
        self.scenario, self.line = scenario, cut.line
        self._all, self._instants = list(_interpolated(records)), []
        self._news = [
            one
            for one in records_of(records, MissionModeChanged)
            if one.mode in (PLANS, FOLLOWS, KNOWS, FORGETS, STARTS)
        ]
        self._news += [MissionModeChanged(round(one.at_s * S), one.node, _ENDS) for one in killed]
        self._news.sort(key=_when)
        self._now_ns = 0

    def advance(self, until_ns: int) -> None:
        self._now_ns = until_ns
        self._instants = [one for one in self._all if one.t_ns <= until_ns]

    def planning(self) -> set[int]:
        return self._since(PLANS, FOLLOWS, STARTS)

    def stopped(self) -> set[int]:
        return self._since(_ENDS, STARTS)

    def _since(self, begins: str, *ends: str) -> set[int]:
        """The UAVs of which the first of these is true, and none of the others since then."""
        found = set[int]()
        for one in self._until_now():
            if one.mode == begins:
                found.add(one.node)
            elif one.mode in ends:
                found.discard(one.node)
        return found

    def finds(self) -> dict[int, set[int]]:
        found: dict[int, set[int]] = {int(node): set() for node in self.scenario.uav_ids}
        for one in self._until_now():
            if one.mode == KNOWS:
                found[one.node].add(one.survivor)
            elif one.mode == FORGETS:
                found[one.node].discard(one.survivor)
            elif one.mode == STARTS:
                found[one.node].clear()
        return found

    def _until_now(self) -> list[MissionModeChanged]:
        return self._news[: bisect_right(self._news, self._now_ns, key=_when)]


def _when(record: MissionModeChanged) -> int:
    return record.t_ns


def _interpolated(records: Sequence[Record]) -> Iterator[Instant]:
    """Where all UAVs were, ten times a second; the trace has their positions about once a second."""
    rows: dict[int, list[tuple[float, ...]]] = {}
    for one in records_of(records, Posed):
        rows.setdefault(one.node, []).append((one.t_ns, one.east_m, one.north_m, one.up_m))
    ids = np.array(sorted(rows))
    ways = [np.array(sorted(rows[node])) for node in ids.tolist()]
    steps = range(max(round(way[0, 0]) for way in ways), min(round(way[-1, 0]) for way in ways), S // 10)
    for t_ns in steps:
        at = [[np.interp(t_ns, way[:, 0], way[:, axis]) for axis in (1, 2, 3)] for way in ways]
        yield Instant(t_ns, ids, np.array(at))


def judged(flight: Parted, at_s: float) -> dict[str, Any]:
    """What becomes of a swarm whose air is parted since `at_s`."""
    planners, crossed, looks = {}, {}, list[tuple[int, bool]]()
    for step in range(1, round(_FOR_S / _LOOKS_S) + 1):
        after_s = step * _LOOKS_S
        flight.advance(round((at_s + after_s) * S))
        now = flight.planners(cut=True)
        if after_s in _SHOWN_S:
            planners[round(after_s)], crossed[round(after_s)] = now, flight.crossed()
        looks.append((round(after_s * S), any(leads != 1 for _, leads in now)))
    wrong = [[from_s - _LOOKS_S, until_s] for from_s, until_s in stretches(looks)]
    knowledge = flight.finds()
    everything = set[int]().union(*knowledge.values())
    merged, unknown = {}, {0: sum(knows != everything for knows in knowledge.values())}
    for after_s in (1, 2, 3, 5, 8):
        flight.advance(round((at_s + _FOR_S + after_s) * S))
        merged[after_s] = flight.planners(cut=False)
        unknown[after_s] = sum(not everything <= knows for knows in flight.finds().values())
    flight.advance(round((at_s + _ON_S) * S))
    return {
        "scenario": flight.scenario.name, "seed": flight.scenario.seed, "at_s": at_s,
        "angle": round(flight.line.angle, 2), "off_m": round(flight.line.off_m),
        "parts": planners, "crossed": crossed, "wrong": wrong, "merged": merged,
        "unknown": unknown, "finds": len(everything), "least_m": flight.least_m(round(at_s * S)),
    }  # fmt: skip


def fork(scenario: Scenario, cuts: Sequence[Cut]) -> None:
    """Fly once, and in a copy of the process at each cut."""
    with GARBAGE.not_collected():
        flight = Forked(scenario)
        for at_s, line in cuts:
            flight.host.run(round(at_s * S))
            child = os.fork()
            if child:
                os.waitpid(child, 0)
                continue
            flight.part(line)
            print(json.dumps(judged(flight, at_s)), flush=True)
            os._exit(0)


def launched(
    scenario: Scenario, settings: Sequence[str], cut: Cut, killed: Sequence[Killed], out: Path
) -> dict[str, Any]:
    """Launch the swarm, part the air, and kill programs, which are started again."""
    at_s, line = cut
    east, north, other_east, other_north = line.ends
    faults = [
        f'{{kind="partition",at_s={at_s},for_s={_FOR_S},line_m=[[{east},{north}],[{other_east},{other_north}]]}}',
        *(f'{{kind="stop",at_s={one.at_s},for_s={_STARTED_S},node={one.node}}}' for one in killed),
    ]
    more = [
        f"duration_s={math.ceil(at_s + _ON_S) + 1}",
        f"faults=[{','.join(faults)}]",
        'applications=[{use="search_witness:Witness"}]',
    ]
    command = [sys.executable, "-m", "fanet_mw", "launch", scenario.name, "--out", str(out), "--force"]
    command += ["--respawn", "--slow-down-to", f"{_SLOWEST}"]
    command += [word for one in (*settings, *more) for word in ("--set", one)]
    path = os.pathsep.join((str(ROOT), str(ROOT / "scripts")))
    subprocess.run(command, check=False, stdout=sys.stderr, env={**os.environ, "PYTHONPATH": path})  # noqa: S603
    summary = json.loads((out / SUMMARY_FILE).read_text())
    records = [parse(one) for one in (out / TRACE_FILE).read_text().splitlines()]
    return judged(Recorded(scenario, records, cut, killed), at_s) | {
        "processes": len(scenario.uav_ids), "killed": killed,
        "valid": summary["valid"], "invalid_because": summary["invalid_because"],
        "pace": round(summary["simulated_s"] / summary["wall_s"], 2),
    }  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seed", type=int)
    parser.add_argument("count", type=int)
    parser.add_argument("--scenario", default="rescue")
    parser.add_argument("--set", action="append", default=[], dest="settings")
    parser.add_argument("--first-s", type=float, default=_FROM_S, help="the earliest instant of a cut")
    parser.add_argument("--processes", action="store_true", help="launch the swarm anew for each line")
    parser.add_argument("--kill", type=int, default=0, help="so many programs are killed and started again")
    parser.add_argument("--out", type=Path, help="keep the launches in this folder")
    asked = parser.parse_args(arguments)
    if asked.kill and not asked.processes:
        parser.error("--kill kills processes: give --processes, too")
    settings = ["traffic.interval_s=100000", *asked.settings, f"seed={asked.seed}"]
    scenario = find(asked.scenario, settings)
    draw = random.Random(f"lines {scenario.name} {scenario.seed}")
    lines = sorted(
        (
            round(draw.uniform(asked.first_s, _UNTIL * scenario.duration_s), 1),
            draw.uniform(0, math.pi),
            draw.uniform(-1, 1),
        )
        for _ in range(asked.count)
    )
    aside_m = _ASIDE_M * min(1.0, scenario.world.area_m / _WHOLE_M)
    cuts = [Cut(at_s, Line(angle, aside_m * aside)) for at_s, angle, aside in lines]
    if not asked.processes:
        fork(scenario, cuts)
        return
    for cut in cuts:
        who = draw.sample(list(scenario.uav_ids), asked.kill)
        killed = [Killed(round(cut.at_s + draw.uniform(*_KILLED_S), 1), int(node)) for node in who]
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "run" if asked.out is None else asked.out / f"{scenario.seed}-{cut.at_s:g}"
            print(json.dumps(launched(scenario, settings, cut, killed, out)), flush=True)


if __name__ == "__main__":
    main()
