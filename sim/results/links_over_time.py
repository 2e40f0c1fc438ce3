"""Who was within reach of whom, second by second, by the true positions in the trace and the reach of the channel.

    link in second k   both on the air, within reach at its beginning or at its end, and not parted by a fault then

Obstacles, fading, weaker links and collisions are left out: this is what distance allows, and partitions and jammers.
`connectivity` is the same on the ideal track of the mobility model; no protocol that delivers packets at once can
exceed it, one that carries packets for a while can.
"""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from agents.applications.traffic import sources_of, targets_of
from emulator.channel.link_budget import heard_m
from fanet_mw.scenario.model import Scenario
from fanet_mw.trace import Posed, ProcessEnded, ProcessStarted, RadioFault, Record
from fanet_mw.units import S
from sim.records.record_kinds import records_of
from sim.results.outcome import Outcome
from sim.results.parted_air import Extent, PartedAir, parted
from sim.world.arrays import Flags, Rows
from sim.world.environment.layout import positions
from sim.world.mobility.guidance import Guidance


def parts(linked: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """The number of the connected component of each node; `linked` holds for a node and itself, too."""
    part = np.arange(len(linked))
    while True:
        lower = np.where(linked, part[None], len(linked)).min(axis=1, initial=len(linked))
        if (lower == part).all():
            return part
        part = lower


def connectivity(scenario: Scenario) -> float:
    """The share of (source, target, second of the measured window) with a multi-hop path of `radio.range_m` links."""
    guidance = Guidance(np.array(positions(scenario)[: scenario.nodes.count], dtype=np.float64), scenario)
    first_ns, end_ns = scenario.traffic_window_ns
    pairs = [(source, target) for source in sources_of(scenario) for target in targets_of(scenario, source)]
    if not pairs:
        return 0.0
    sources, targets = np.array(pairs).T - 1
    shares = []
    for t_s in range(first_ns // S, max(end_ns // S, first_ns // S + 1)):
        at = guidance.track(float(t_s)).places
        part = parts(within(at, scenario.radio.range_m))
        shares.append(float((part[sources] == part[targets]).mean()))
    return float(np.mean(shares))


_OFF_AIR: Final = frozenset({"cut", "mute", "deaf", "stop", "crash"})
"""The faults that take a UAV out of the network."""


class Absentees:
    """The UAVs whose process has ended, and those off the air by a fault, as records tell in their order."""

    KINDS: Final = (ProcessEnded, ProcessStarted, RadioFault)
    """The kinds of records that tell it."""

    def __init__(self) -> None:
        self.dead: set[int] = set()
        self._faults: dict[str, int] = {}

    @property
    def off_air(self) -> set[int]:
        return set(self._faults.values())

    def take(self, record: Record) -> None:
        if type(record) is ProcessEnded:
            self.dead.add(record.node)
        elif type(record) is ProcessStarted:
            self.dead.discard(record.node)
        elif type(record) is RadioFault and record.kind in _OFF_AIR:
            self._faults.pop(record.label, None)
            self._faults.update({record.label: record.node} if record.active else {})


class LinksOverTime:
    """The links of each second of a run; rows and columns are node ids less one."""

    def __init__(self, outcome: Outcome) -> None:
        self._reach_m = heard_m(outcome.scenario.radio)
        self.seconds = max(1, -(-outcome.simulated_ns // S))
        self._instants = _instants(outcome, self.seconds + 1)
        self._near: dict[int, Flags] = {}
        self._links: dict[int, Flags] = {}

    def at(self, second: int) -> Flags:
        """Whether each pair had a link in a second, each node with itself; the same array while nothing changes."""
        if second not in self._links:
            links, before = self._near_at(second) | self._near_at(second + 1), self._links.get(second - 1)
            self._links[second] = before if before is not None and np.array_equal(before, links) else links
        return self._links[second]

    def _near_at(self, instant: int) -> Flags:
        now = self._instants[instant]
        if id(now) not in self._near:
            nodes = np.arange(1, len(now.at) + 1)
            self._near[id(now)] = within(now.at, self._reach_m) & ~parted(now.extents, now.at, nodes)
        return self._near[id(now)]


def within(at: Rows, reach_m: float) -> Flags:
    """Whether each pair of nodes is within reach; a node that is nowhere (NaN) is within that of itself only."""
    near: Flags = np.linalg.norm(at[:, None] - at[None], axis=2) <= reach_m
    near |= np.eye(len(at), dtype=bool)
    return near


class _Instant(NamedTuple):
    """The positions, NaN of nodes off the air, and what parts the air."""

    at: Rows
    extents: tuple[Extent, ...]


def _instants(outcome: Outcome, count: int) -> list[_Instant]:
    """The beginning of each second; the same object while nothing changes."""
    at = np.array(positions(outcome.scenario), dtype=np.float64)
    absent, air = Absentees(), PartedAir(outcome.scenario.radio)
    found: list[_Instant] = []
    changed = True

    def fill(until: int) -> None:
        nonlocal changed
        while len(found) < min(count, until):
            if changed:
                now = at.copy()
                now[[node - 1 for node in absent.dead | absent.off_air if 1 <= node <= len(at)]] = np.nan
            found.append(_Instant(now, air.in_force) if changed else found[-1])
            changed = False

    for record in records_of(outcome.records, Posed, *Absentees.KINDS):
        fill(-(-record.t_ns // S))
        if type(record) is Posed:
            at[record.node - 1] = record.east_m, record.north_m, record.up_m
        else:
            absent.take(record)
        if type(record) is RadioFault:
            air.take(record)
        changed = True
    fill(count)
    return found
