"""Who was within reach of whom, second by second, by the true positions in the trace and the reach of the channel,
which is greater for an antenna with a gain.

    link in second k   both on the air, within reach at its beginning or at its end, and not parted by a fault then

Obstacles, fading, weaker links and collisions are left out: this is what distance allows, and partitions and jammers.
`connectivity` is the same on the ideal track of the mobility model; no protocol that delivers packets at once can
exceed it, one that carries packets for a while can.
"""

from collections.abc import Mapping
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
from sim.world.arrays import Flags, Rows, Values
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
    """The share of (source, target, second of the measured window) with a multi-hop path of links of `radio.range_m`,
    longer ones of the post on the ground by its antenna.
    """
    starts, on_ground = np.split(np.array(positions(scenario), dtype=np.float64), [scenario.nodes.count])
    guidance = Guidance(starts, scenario)
    reach_m = _of_pairs(
        scenario, scenario.radio.range_m, {n: x * scenario.radio.range_m for n, x in scenario.reaches.items()}
    )
    first_ns, end_ns = scenario.traffic_window_ns
    pairs = [(source, target) for source in sources_of(scenario) for target in targets_of(scenario, source)]
    if not pairs:
        return 0.0
    sources, targets = np.array(pairs).T - 1
    shares = []
    for t_s in range(first_ns // S, max(end_ns // S, first_ns // S + 1)):
        at = np.vstack([guidance.track(float(t_s)).places, on_ground])
        part = parts(within(at, reach_m))
        shares.append(float((part[sources] == part[targets]).mean()))
    return float(np.mean(shares))


def heard_between_m(scenario: Scenario) -> Values:
    """The greatest distance of reception between each two nodes, without shadowing and fading [m, n x n]."""
    posts_m = heard_m(scenario.radio, gain_dbi=scenario.ground.gain_dbi)
    return _of_pairs(scenario, heard_m(scenario.radio), dict.fromkeys(scenario.reaches, posts_m))


def _of_pairs(scenario: Scenario, reach_m: float, others_m: Mapping[int, float]) -> Values:
    """The reach between each two nodes; `others_m`: that of all links of some nodes."""
    found = np.full((scenario.node_count, scenario.node_count), reach_m)
    for node, other_m in others_m.items():
        found[node - 1] = found[:, node - 1] = other_m
    return found


_OFF_AIR: Final = frozenset({"cut", "mute", "deaf", "stop", "crash"})
"""The faults that take a UAV out of the network."""


class Absentees:
    """The nodes whose process has ended, and those off the air by a fault, after the records that were taken in."""

    KINDS: Final = (ProcessEnded, ProcessStarted, RadioFault)
    """The kinds of records that tell it."""

    def __init__(self) -> None:
        self.dead: set[int] = set()
        """The nodes whose process has ended and was not started again."""
        self._faults: dict[str, int] = {}
        """The node of each fault in force, by the label of the fault."""

    @property
    def off_air(self) -> set[int]:
        """The nodes that neither have links nor are searching, because of a fault in force."""
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
        self._reach_m = heard_between_m(outcome.scenario)
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


def within(at: Rows, reach_m: Values) -> Flags:
    """Whether each two nodes are within reach [m, n x n]; a node that is nowhere (NaN) is in reach of itself only."""
    near: Flags = np.linalg.norm(at[:, None] - at[None], axis=2) <= reach_m
    near |= np.eye(len(at), dtype=bool)
    return near


class _Instant(NamedTuple):
    """What decides about links at one instant."""

    at: Rows
    """The positions of all nodes, NaN of nodes off the air."""
    extents: tuple[Extent, ...]
    """The partitions and jammed areas in force."""


def _instants(outcome: Outcome, count: int) -> list[_Instant]:
    """The swarm at the beginning of each second; the same object while nothing changes."""
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
