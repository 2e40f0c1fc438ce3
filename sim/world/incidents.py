"""The incidents of a run, which are counted: contacts, losses of separation, entries into no-fly areas; and mishaps.

Mishaps befall single UAVs at planned instants, or on command: a crash, a weak battery, a receiver that is wrong or
silent. The medium records when each begins and ends (`emulator/faults.py`).
"""

import heapq
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fanet_mw.bus.radio_control import Control, Mishap, MishapKind, Restore, wrong
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from sim.world.arrays import Flags, Rows
from sim.world.engines.contacts import approaches


class Separation:
    """The least distance of two UAVs, and how often two came too near; ways within a step are straight."""

    def __init__(self, distance_m: float) -> None:
        """`distance_m`: the distance that any two UAVs should keep; with 0 nothing is watched."""
        self._distance_m = distance_m
        self._least_m: float | None = None
        self._near: frozenset[tuple[int, int]] = frozenset()
        self._losses = 0

    def watch(self, before: Rows, after: Rows) -> None:
        """Watch one step between two positions [nodes, 3] in m. A pair that stays near counts once."""
        if not self._distance_m or len(before) < 2:
            return
        within_m = math.inf if self._least_m is None else max(self._distance_m, self._least_m)
        first, second, distance = approaches(before, after, within_m=within_m)
        if len(distance):
            least = float(distance.min())
            self._least_m = least if self._least_m is None else min(self._least_m, least)
        rows = np.flatnonzero(distance < self._distance_m).tolist()
        near = frozenset((int(first[row]), int(second[row])) for row in rows)
        self._losses += len(near - self._near)
        self._near = near

    def report(self) -> Mapping[str, Any]:
        """The report; `least_m` is None while nothing has moved. It is empty if nothing is watched."""
        if not self._distance_m:
            return {}
        return {"least_m": None if self._least_m is None else round(self._least_m, 2), "losses": self._losses}


class NoFlyEntries:
    """Counts entries into areas that are upright cylinders without a top."""

    def __init__(self, areas: Sequence[tuple[float, float, float]], starts: Rows) -> None:
        """`areas`: (east, north, radius) [m]; raises ConfigError if a UAV would start in one."""
        self._areas = np.array(areas, dtype=np.float64).reshape(-1, 3)
        self._within = np.zeros((len(starts), len(self._areas)), bool)
        self.entries = 0
        """The number of times that a UAV came into an area."""
        rows, columns = np.nonzero(self._reached(starts, starts))
        if len(rows):
            raise ConfigError(f"world.no_fly_m.{columns[0]}: node {rows[0] + 1} starts within it")

    def watch(self, before: Rows, after: Rows) -> None:
        """Count the UAVs that enter an area on their straight ways, also those that leave it at once."""
        if not len(self._areas):
            return
        self.entries += int((self._reached(before, after) & ~self._within).sum())
        self._within = self._reached(after, after)

    def _reached(self, before: Rows, after: Rows) -> Flags:
        """Whether the nearest place to the middle of each area on each way is within the area [nodes, areas]."""
        way = (after - before)[:, None, :2]
        off = before[:, None, :2] - self._areas[None, :, :2]
        share = np.clip(-(off * way).sum(axis=2) / np.maximum((way**2).sum(axis=2), 1e-12), 0.0, 1.0)
        return np.asarray(np.linalg.norm(off + way * share[..., None], axis=2) <= self._areas[:, 2])


class Incidents:
    """The incidents of one run."""

    def __init__(self, scenario: Scenario, starts: Rows) -> None:
        """Raises ConfigError if a UAV would start in a no-fly area."""
        self.collisions = 0
        self.no_fly = NoFlyEntries(scenario.world.no_fly_m, starts)
        self.separation = Separation(scenario.mission.collision_distance_m)


class Mishaps:
    """The mishaps of one swarm: those to come, and the receivers that are wrong or silent now.

    Any fault ends one with its label, as on the air.
    """

    def __init__(self, scenario: Scenario) -> None:
        """A world that continues an earlier one brings about again what that one did, which changes nothing."""
        self._count, self._nodes = scenario.nodes.count, scenario.node_count
        self._order = 0
        self._agenda: list[tuple[int, int, Control]] = []
        self._standing: dict[str, tuple[Mishap, int]] = {}
        """Of each receiver that is wrong or silent: why, and until when; 0: until it is restored."""
        self.offset_m: Rows = np.zeros((self._count, 3))
        """By how much each GPS receiver is wrong."""
        self.silent: Flags = np.zeros(self._count, bool)
        """The GPS receivers that give no position."""
        for at_ns, control in scenario.planned_faults:
            self.add(control, at_ns)

    def add(self, control: Control, at_ns: int) -> None:
        """Something happens at this instant; what is impossible is passed over."""
        count = self._count if isinstance(control, Mishap) else self._nodes
        if isinstance(control, Restore) or wrong(control, count=count) is None:
            heapq.heappush(self._agenda, (at_ns, self._order, control))
            self._order += 1

    def due(self, now_ns: int) -> Iterable[Mishap]:
        """The mishaps that have happened since the last call; receivers become wrong or silent, or right again."""
        before, begun = [*self._standing.values()], []
        while self._agenda and self._agenda[0][0] <= now_ns:
            at_ns, _, control = heapq.heappop(self._agenda)
            self._end_by(at_ns)
            for label in [control.label] if control.label else [*self._standing]:
                self._standing.pop(label, None)
            if isinstance(control, Mishap):
                if control.what in (MishapKind.GPS, MishapKind.GPS_OFF):
                    self._standing[control.label] = control, at_ns + control.for_ns if control.for_ns else 0
                begun.append(control)
        self._end_by(now_ns)
        if before != [*self._standing.values()]:
            self._tell()
        return begun

    def _end_by(self, now_ns: int) -> None:
        for label in [label for label, (_, until_ns) in self._standing.items() if until_ns and until_ns <= now_ns]:
            del self._standing[label]

    def _tell(self) -> None:
        self.offset_m[:], self.silent[:] = 0.0, False
        for mishap, _ in self._standing.values():
            if mishap.what is MishapKind.GPS:
                self.offset_m[mishap.node - 1] += mishap.value
            else:
                self.silent[mishap.node - 1] = True
