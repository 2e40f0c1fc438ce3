"""Replays a mission from the files of its run: where each UAV was, what it did, and which area was covered.

position      `posed`, once a second; in between on a straight line
flight        `flight_mode_changed`: the mode of the flight controller; from `fallen` on the UAV is a wreck
mission       `mission_mode_changed`: the UAV's decision, and for which survivor; `planned`: its place in the plan
sensors       `detected`, `sighted`
finds         `approaching`, `arrived`, `confirmed`
"""

import tomllib
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.trace import FlightModeChanged, MissionModeChanged, Planned, Posed, Record
from fanet_mw.units import Enu, NodeId, S
from sim.results.file_names import SCENARIO_FILE
from sim.results.mission import OverflownCells, mission
from sim.results.trace_file import read_trace

R = TypeVar("R", FlightModeChanged, MissionModeChanged, Planned)


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


class Replay:
    """A finished run that can be looked at, at any instant."""

    def __init__(self, scenario: Scenario, records: Sequence[Record]) -> None:
        """`records`: the trace records, in the order of the trace."""
        self.scenario, self.records = scenario, records
        self._posed: dict[int, list[Posed]] = defaultdict(list)
        self._flight: dict[int, list[FlightModeChanged]] = defaultdict(list)
        self._mission: dict[int, list[MissionModeChanged]] = defaultdict(list)
        self._planned: dict[int, list[Planned]] = defaultdict(list)
        for record in records:
            if isinstance(record, Posed):
                self._posed[record.node].append(record)
            elif isinstance(record, FlightModeChanged):
                self._flight[record.node].append(record)
            elif isinstance(record, MissionModeChanged):
                self._mission[record.node].append(record)
            elif isinstance(record, Planned):
                self._planned[record.node].append(record)

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read what `fanet simulate --out` or `fanet launch --out` has written; raises ConfigError."""
        try:
            keys = tomllib.loads((folder / SCENARIO_FILE).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise ConfigError(f"{folder}: cannot be replayed: {error}") from error
        return cls(Scenario.model_validate(keys), list(read_trace(folder)))

    def at(self, t_s: float) -> Mapping[NodeId, UavState]:
        """The states of all UAVs at an instant. A wreck is where it was last seen flying."""
        t_ns = round(t_s * S)
        found = {}
        for node, posed in sorted(self._posed.items()):
            flight = _last(self._flight[node], t_ns)
            decided = _last(self._mission[node], t_ns)
            planned = _last(self._planned[node], t_ns)
            found[NodeId(node)] = UavState(
                _between(posed, t_ns),
                flight.mode if flight else "",
                decided.mode if decided else "",
                decided.survivor if decided else 0,
                planned.place if planned else -1,
            )
        return found

    def coverage(self, t_s: float) -> float:
        """The share of the area that was covered by an instant."""
        covered = OverflownCells(self.scenario)
        for record in self.records:
            if isinstance(record, Posed) and record.t_ns <= t_s * S:
                covered.add([(record.east_m, record.north_m, record.up_m)])
        return covered.share

    def mission(self) -> Mapping[str, Any]:
        """The table `mission` of the summary, computed anew."""
        return mission(self.scenario, self.records)


def _last(records: Sequence[R], t_ns: int) -> R | None:
    """The latest of some records of one UAV up to an instant."""
    index = bisect_right(records, t_ns, key=lambda record: record.t_ns)
    return records[index - 1] if index else None


def _between(posed: Sequence[Posed], t_ns: int) -> Enu:
    """The position of a UAV between two of its records, or at the first or the last one."""
    after = bisect_right(posed, t_ns, key=lambda record: record.t_ns)
    first, second = posed[max(0, after - 1)], posed[min(after, len(posed) - 1)]
    span_ns = second.t_ns - first.t_ns
    share = min(1.0, max(0.0, (t_ns - first.t_ns) / span_ns)) if span_ns > 0 else 0.0
    place = [a + share * (b - a) for a, b in zip(first[2:], second[2:], strict=True)]
    return Enu(*place)
