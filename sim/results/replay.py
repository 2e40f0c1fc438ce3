"""Replays a mission from the trace of its run: where each UAV was, what it did, and which area was covered.

Between positions, once a second, UAVs are on a straight line; a swarm that stands has none, and is at its start.
"""

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np
import numpy.typing as npt

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.trace import FlightModeChanged, MissionModeChanged, Planned, Posed, Record, RoleChanged
from fanet_mw.units import Enu, NodeId, S
from sim.results.mission import CoveredCells, SurvivorState, SurvivorStates, covered_over_time
from sim.results.run_folder import RunFolder
from sim.world.environment.layout import positions
from sim.world.environment.survivors import place

R = TypeVar("R", FlightModeChanged, MissionModeChanged, Planned, RoleChanged)


class UavState(NamedTuple):
    """The state of one UAV at one instant."""

    position: Enu
    flight: str
    """The mode of its flight controller; empty if it was not commanded yet."""
    mission: str
    """The mode of its mission; empty if it takes no part in a planned search."""
    survivor: int
    """The survivor to whom it flew; 0 if there was none."""
    place: int
    """Its place in the plan; -1 if it had none."""
    role: str
    """Its role in its cluster; empty if it had none yet."""
    head: int


class Replay:
    """A finished run that can be looked at, at any instant."""

    def __init__(self, scenario: Scenario, records: Sequence[Record]) -> None:
        """`records`: the trace records, in the order of the trace."""
        self.scenario, self.records = scenario, records
        self._posed: dict[int, list[Posed]] = defaultdict(list)
        self._changes: dict[tuple[type[Any], int], list[Any]] = defaultdict(list)
        """The records of each kind that change the state of a UAV, by kind and UAV."""
        for record in records:
            if isinstance(record, Posed):
                self._posed[record.node].append(record)
            elif isinstance(record, FlightModeChanged | MissionModeChanged | Planned | RoleChanged):
                self._changes[type(record), record.node].append(record)
        if not self._posed and scenario.mobility.model == "static":
            for node, at in zip(scenario.uav_ids, positions(scenario), strict=False):  # the post comes last
                self._posed[node] = [Posed(0, node, *at)]

    @property
    def nodes(self) -> Sequence[NodeId]:
        """The UAVs whose positions are known; raises ConfigError if there are none."""
        if not self._posed:
            raise ConfigError("the trace has no positions of UAVs (`posed`), so there is nothing to replay")
        return [NodeId(node) for node in sorted(self._posed)]

    @classmethod
    def read(cls, folder: Path, *kinds: type[Any]) -> Self:
        """Read the folder of a run, or records of these kinds alone; raises ConfigError."""
        found = RunFolder(folder)
        return cls(found.scenario, list(found.records(*kinds)))

    def at(self, t_s: float) -> Mapping[NodeId, UavState]:
        """The states of all UAVs at an instant. A wreck is where it was last seen flying."""
        t_ns = round(t_s * S)
        found = {}
        for node, position in self.positions(t_s).items():
            flight = self._latest(FlightModeChanged, node, t_ns)
            decided = self._latest(MissionModeChanged, node, t_ns)
            planned = self._latest(Planned, node, t_ns)
            role = self._latest(RoleChanged, node, t_ns)
            found[node] = UavState(
                position,
                flight.mode if flight else "",
                decided.mode if decided else "",
                decided.survivor if decided else 0,
                planned.place if planned else -1,
                role.role if role else "",
                role.head if role else 0,
            )
        return found

    def positions(self, t_s: float) -> Mapping[NodeId, Enu]:
        """The positions alone of all UAVs at an instant."""
        t_ns = round(t_s * S)
        return {NodeId(node): _between(posed, t_ns) for node, posed in sorted(self._posed.items())}

    @cached_property
    def survivors(self) -> Sequence[Enu]:
        """The true places of the survivors, in the order of their ids; raises ConfigError if they are not known."""
        return place(self.scenario)

    @cached_property
    def finds(self) -> Mapping[int, Sequence[SurvivorState]]:
        """All states of each survivor, in the order of time; the first one is `not heard`, from the start."""
        found = SurvivorStates(self.survivors)
        states = {survivor: [state] for survivor, state in found.now.items()}
        for record in self.records:
            change = found.take(record)
            if change is not None:
                states[change[0]].append(change[1])
        return states

    def found(self, t_s: float) -> Mapping[int, SurvivorState]:
        return {
            survivor: next(state for state in reversed(states) if state.t_ns <= max(0, round(t_s * S)))
            for survivor, states in self.finds.items()
        }

    @cached_property
    def covered_ns(self) -> npt.NDArray[np.int64]:
        """The instant at which each cell was covered first, -1: never; rows from south to north."""
        first = np.full(CoveredCells(self.scenario).seen.shape, -1, np.int64)
        for t_ns, cells in covered_over_time(self.scenario, self._posed.values()):
            first[cells.seen & (first < 0)] = t_ns
        return first

    def coverage(self, t_s: float) -> float:
        first = self.covered_ns
        return float(((first >= 0) & (first <= round(t_s * S))).mean())

    def _latest(self, kind: type[R], node: NodeId, t_ns: int) -> R | None:
        records: Sequence[R] = self._changes.get((kind, node), ())
        index = bisect_right(records, t_ns, key=lambda record: record.t_ns)
        return records[index - 1] if index else None


def _between(posed: Sequence[Posed], t_ns: int) -> Enu:
    """The position of a UAV between two of its records, or at the first or the last one."""
    after = bisect_right(posed, t_ns, key=lambda record: record.t_ns)
    first, second = posed[max(0, after - 1)], posed[min(after, len(posed) - 1)]
    share = min(1.0, max(0.0, (t_ns - first.t_ns) / max(1, second.t_ns - first.t_ns)))
    place = [a + share * (b - a) for a, b in zip(first[2:], second[2:], strict=True)]
    return Enu(*place)
