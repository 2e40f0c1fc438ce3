#!/usr/bin/env python
"""Part the air of one search for 20 s along drawn lines: `python scripts/partitions.py SEED COUNT`.

At each drawn instant the process forks, and the copy flies on for 45 s. One JSON line for each:

    parts    the sizes of the parts while the air is parted, and how many planners each has 3, 5, 10 and 19 s later
    crossed  how many have flown over the line within the 3 s before that: their new part hardly knows them yet
    wrong    all stretches, from when until when after the cut, in which some part had no planner or several [s]
    merged   the same 1, 2, 3, 5 and 8 s after the air is whole again: who has closed ranks may be out of reach still
    unknown  to how many a find that anybody knew then is unknown: just before, and 1, 2, 3, 5 and 8 s after
    least_m  the least distance of two UAVs from the cut on
"""

# ruff: noqa: SLF001  (what a UAV knows, and whether it plans, nobody is told)
import argparse
import json
import math
import os
import random
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from agents.mission.applications import PlannedSearch  # noqa: E402  (the tree's root is on the path now)
from agents.uav import Uav  # noqa: E402
from fanet_mw.bus.radio_control import PARTITION_LABEL, Partition  # noqa: E402
from fanet_mw.units import S  # noqa: E402
from scripts.losses import Flight, stretches  # noqa: E402
from sim.results.connectivity import parts  # noqa: E402
from sim.run.garbage import GARBAGE  # noqa: E402
from sim.run.stoppable_uav import StoppableUav  # noqa: E402
from sim.scenarios.catalog import find  # noqa: E402

_FOR_S: Final = 20.0
_FROM_S: Final = 60.0
_UNTIL: Final = 0.75
_FAR_M: Final = 2000.0
_ASIDE_M: Final = 500.0
_LOOKS_S: Final = 0.5
_SHOWN_S: Final = (3, 5, 10, 19)


class Parted(Flight):
    """A flight whose air is parted along a line."""

    def part(self, angle: float, off_m: float) -> None:
        """The line is so far from the middle, at right angles to this direction."""
        self._normal, self._off_m = np.array([math.cos(angle), math.sin(angle)]), off_m
        (east, north), along = off_m * self._normal, _FAR_M * np.array([-math.sin(angle), math.cos(angle)])
        line = (east - along[0], north - along[1], east + along[0], north + along[1])
        self.host.put(self._topics.radio_control, Partition(PARTITION_LABEL, (), line, round(_FOR_S * S)))

    def searches(self) -> dict[int, Any]:
        """The search on board of each UAV; what it knows is not told to anybody, so this looks inside."""
        found = {}
        for actor in self._actors:
            uav = actor._uav if isinstance(actor, StoppableUav) else actor
            if isinstance(uav, Uav):
                applications = uav._onboard._applications
                found[uav._node.node] = next(a._searcher for a in applications if isinstance(a, PlannedSearch))
        return found

    def planners(self, *, cut: bool) -> list[tuple[int, int]]:
        """The size of each part, and how many in it take themselves for its planner."""
        _, ids, at = self._instants[-1]
        near = np.linalg.norm(at[:, None] - at[None], axis=2) <= self.scenario.radio.range_m
        side = at[:, :2] @ self._normal > self._off_m
        part = parts(near & (side[:, None] == side[None]) if cut else near)
        leads = {n for n, search in self.searches().items() if search._plans._planner._leads(self.host.now_ns)}
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
        return [bool(beyond) for beyond in at[:, :2] @ self._normal > self._off_m]

    def finds(self) -> dict[int, set[int]]:
        """Whom each UAV knows to be confirmed."""
        return {
            node: {number for number, known in search._survivors.by_id.items() if known.confirmed is not None}
            for node, search in self.searches().items()
        }

    def least_m(self, from_ns: int) -> float:
        apart = [np.linalg.norm(at[:, None] - at[None], axis=2) for t_ns, _, at in self._instants if t_ns >= from_ns]
        return round(float(min((one + np.diag(np.full(len(one), np.inf))).min() for one in apart)), 1)


def judged(flight: Parted, at_s: float, angle: float, off_m: float) -> dict[str, Any]:
    """Fly on with the air parted, and what became of the swarm."""
    flight.part(angle, off_m)
    planners, crossed, looks = {}, {}, list[tuple[int, bool]]()
    for step in range(1, round(_FOR_S / _LOOKS_S) + 1):
        after_s = step * _LOOKS_S
        flight.host.run(round((at_s + after_s) * S))
        now = flight.planners(cut=True)
        if after_s in _SHOWN_S:
            planners[round(after_s)], crossed[round(after_s)] = now, flight.crossed()
        looks.append((round(after_s * S), any(leads != 1 for _, leads in now)))
    wrong = [[from_s - _LOOKS_S, until_s] for from_s, until_s in stretches(looks)]
    known = flight.finds()
    everything = set[int]().union(*known.values())
    merged, unknown = {}, {0: sum(known[node] != everything for node in known)}
    for after_s in (1, 2, 3, 5, 8):
        flight.host.run(round((at_s + _FOR_S + after_s) * S))
        merged[after_s] = flight.planners(cut=False)
        unknown[after_s] = sum(not everything <= knows for knows in flight.finds().values())
    flight.host.run(round((at_s + 45) * S))
    return {
        "scenario": flight.scenario.name, "seed": flight.scenario.seed, "at_s": at_s, "angle": round(angle, 2),
        "off_m": round(off_m), "parts": planners, "crossed": crossed, "wrong": wrong, "merged": merged,
        "unknown": unknown, "least_m": flight.least_m(round(at_s * S)),
    }  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seed", type=int)
    parser.add_argument("count", type=int)
    parser.add_argument("--scenario", default="rescue")
    parser.add_argument("--set", action="append", default=[], dest="settings")
    asked = parser.parse_args(arguments)
    scenario = find(asked.scenario, ["traffic.interval_s=100000", *asked.settings, f"seed={asked.seed}"])
    draw = random.Random(f"lines {scenario.name} {scenario.seed}")
    lines = sorted(
        (round(draw.uniform(_FROM_S, _UNTIL * scenario.duration_s), 1), draw.uniform(0, math.pi), draw.uniform(-1, 1))
        for _ in range(asked.count)
    )
    with GARBAGE.not_collected():
        flight = Parted(scenario)
        for at_s, angle, aside in lines:
            flight.host.run(round(at_s * S))
            child = os.fork()
            if child:
                os.waitpid(child, 0)
                continue
            print(json.dumps(judged(flight, at_s, angle, _ASIDE_M * aside)), flush=True)
            os._exit(0)


if __name__ == "__main__":
    main()
