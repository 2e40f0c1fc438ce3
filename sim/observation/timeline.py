"""A finished run as `SwarmState` at any instant, forwards and back, from its trace, its telemetry and its recording.

Time goes forward by feeding records; every `_EVERY_NS` the state is kept, so that a jump back begins near its goal.
"""

import pickle
import struct
from array import array
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from fanet_mw.bus.link_stats import COUNTS, LinkStats
from fanet_mw.bus.messages import Poses
from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import json_of, open_regular
from fanet_mw.scenario import Scenario
from fanet_mw.trace import (
    BoundExcludes,
    BoundStated,
    Collided,
    Confirmed,
    Delivered,
    FlightModeChanged,
    Posed,
    ProcessEnded,
    ProcessStarted,
    RadioFault,
    Record,
    Refuted,
    RoleChanged,
)
from fanet_mw.units import MS, STILL, US, S
from fanet_mw.wire import node_of_system
from sim.observation.bus_feed import makes_sense
from sim.observation.event_text import event_line
from sim.observation.swarm_state import Event, SwarmState
from sim.results.replay import Replay
from sim.results.run_folder import RunFolder
from sim.world.environment.layout import positions

_EVERY_NS: Final = 10 * S
_TURNS: Final = ("slots", "turns")
_MOST_TOLD: Final = 1 << 20
_MOST_BROKEN: Final = 50
_NOTABLE: Final = (
    Confirmed,
    Refuted,
    RadioFault,
    ProcessEnded,
    ProcessStarted,
    Collided,
    FlightModeChanged,
    RoleChanged,
)


class _Report(NamedTuple):
    """What an actor reported."""

    t_ns: int
    name: str
    content: Mapping[str, Any]


class Timeline:
    """One finished run."""

    def __init__(self, folder: Path) -> None:
        """Read the files of a run; raises ConfigError."""
        found = RunFolder(folder)
        self.scenario = found.scenario
        records: list[Record] = sorted(found.records(), key=lambda one: one.t_ns)  # some are of a little later
        self._replay = Replay(self.scenario, [one for one in records if isinstance(one, Posed)])
        self.nodes = self._replay.nodes
        post = self.scenario.post
        self._post = None if post is None else (post, positions(self.scenario)[-1])
        self._records = [one for one in records if not isinstance(one, Posed)]
        self.epoch_unix_ns: int = found.summary.get("epoch_unix_ns", 0)
        epoch_ns = self.epoch_unix_ns
        self._taps = [(t_us * US - epoch_ns, frame) for t_us, frame in found.telemetry()]
        self._links, self._told = _recorded(folder, epoch_ns, found.scenario)
        self.has_links = bool(self._links)
        """True if the folder has a recording, which tells what links carried and actors reported each second."""
        self.end_ns = max((one.t_ns for one in records), default=self.scenario.duration_ns)
        self.events: Sequence[Event] = sorted([*_notable(self._records), *_broken(self._records)])
        self._start = SwarmState(self.scenario)
        for node, report in found.agents().items() if not self._told else ():
            told = {name: report[name] for name in _TURNS if report.get(name)}
            self._start.take_report(f"agent-{node}", told, t_ns=0)
        self._kept: list[tuple[int, tuple[int, ...], bytes]] = []
        self.now_ns = 0
        self._next: tuple[int, ...] = (0, 0, 0, 0)
        self.state = self._start
        self._restart()

    def at(self, t_ns: int) -> SwarmState:
        """The state at an instant; the same object as long as time goes forward."""
        t_ns = min(max(0, t_ns), self.end_ns)
        if t_ns < self.now_ns:
            index = bisect_right([kept[0] for kept in self._kept], t_ns)
            if index:
                self.now_ns, self._next, packed = self._kept[index - 1]
                self.state = pickle.loads(packed)  # noqa: S301  (made by this object)
            else:
                self._restart()
        while self.now_ns < t_ns:
            self._go_on(min(t_ns, (self.now_ns // _EVERY_NS + 1) * _EVERY_NS))
        self._pose(t_ns)
        return self.state

    # --- parts ----------------------------------------------------------------------------------------------------

    def _restart(self) -> None:
        self.now_ns = 0
        self._next = (0, 0, 0, 0)
        self.state = pickle.loads(pickle.dumps(self._start))  # noqa: S301  (made by this object)
        self._pose(0)

    def _go_on(self, until_ns: int) -> None:
        """Feed what happened until an instant, second by second, so that trails and coverage are those of the run."""
        records, taps, links, told = self._next
        for second_ns in (*range(self.now_ns // S * S + S, until_ns, S), until_ns):
            end = bisect_right(self._records, second_ns, lo=records, key=lambda one: one.t_ns)
            self._pose(second_ns)
            self.state.take_records(self._records[records:end])
            records = end
            while taps < len(self._taps) and self._taps[taps][0] <= second_ns:
                t_ns, frame = self._taps[taps]
                self.state.take_tap(node_of_system(frame[5], nodes=self.scenario.node_count), t_ns, frame)
                taps += 1
            while links < len(self._links) and self._links[links].t_ns <= second_ns:
                self.state.take_links(self._links[links])
                links += 1
            while told < len(self._told) and self._told[told].t_ns <= second_ns:
                one = self._told[told]
                self.state.take_report(one.name, one.content, t_ns=one.t_ns)
                told += 1
        self.now_ns, self._next = until_ns, (records, taps, links, told)
        if until_ns % _EVERY_NS == 0 and (not self._kept or self._kept[-1][0] < until_ns):
            self._kept.append((until_ns, self._next, pickle.dumps(self.state)))

    def _pose(self, t_ns: int) -> None:
        now, before = self._replay.positions(t_ns / S), self._replay.positions(max(0.0, t_ns / S - 0.5))
        span_s = min(0.5, t_ns / S)
        states: list[float] = []
        for node, at in now.items():
            moved = at.minus(before[node])
            states += [*at, *((value / span_s if span_s else 0.0) for value in moved)]
        ids = array("H", now)
        if self._post is not None and self._post[0] not in now:
            ids.append(self._post[0])
            states += [*self._post[1], *STILL]
        self.state.take_poses(Poses(t_ns, ids, array("d", states)))


def _recorded(folder: Path, epoch_ns: int, scenario: Scenario) -> tuple[list[LinkStats], list[_Report]]:
    """What links carried and actors reported each second, from a recording in the folder, if there is one and MCAP."""
    try:
        from google.protobuf.message import DecodeError
        from mcap.exceptions import McapError
        from mcap.reader import make_reader
        from mcap_protobuf.decoder import DecoderFactory
    except ImportError:
        return [], []
    links: list[LinkStats] = []
    told: list[_Report] = []
    names = {"emulator", *(f"agent-{node}" for node in scenario.node_ids)}
    for path in sorted(folder.glob("*.mcap")):
        try:
            with open_regular(path, follow=False) as file:
                reader = make_reader(file, decoder_factories=[DecoderFactory()])
                for _, channel, message, one in reader.iter_decoded_messages(topics=["/links", "/reports"]):
                    t_ns = message.log_time - epoch_ns
                    if channel.topic == "/links":
                        rows = [(link.src, link.dst, link.copies, link.received) for link in one.links]
                        links.append(_stats(t_ns, round(one.span_s * S), rows))
                    elif one.name in names:
                        told.append(_Report(t_ns, one.name, _content(one.json, source=f"{path}: report of {one.name}")))
        except (McapError, DecodeError, OSError, ValueError, OverflowError, struct.error) as error:
            if isinstance(error, ConfigError):
                raise
            raise ConfigError(f"{path}: cannot be read: {str(error)[:200]}") from error
    once = {stats.t_ns: stats for stats in links}, {one[:2]: one for one in told}  # two may have recorded the run
    return [once[0][t_ns] for t_ns in sorted(once[0])], [once[1][name] for name in sorted(once[1])]


def _content(text: str, *, source: str) -> Mapping[str, Any]:
    """What was kept of a report, checked like one that comes over the bus."""
    content = json_of(text[:_MOST_TOLD].encode(), source=source)
    if not isinstance(content, dict) or not makes_sense(content):
        raise ConfigError(f"{source}: makes no sense")
    for part in ("air", "late"):
        values = content.get(part, {})
        if not isinstance(values, dict) or not all(
            value is None or isinstance(value, int | float) for value in values.values()
        ):
            raise ConfigError(f"{source}: {part} must hold numbers")
    return content


def _stats(t_ns: int, span_ns: int, rows: Sequence[tuple[int, int, int, int]]) -> LinkStats:
    ends = array("H", (end for src, dst, _, _ in rows for end in (src, dst)))
    none = [0] * (COUNTS - 2)
    counts = array("I", (n for _, _, copies, had in rows for n in (had, max(0, copies - had), *none)))
    return LinkStats(t_ns, span_ns, ends, counts, array("q", [0] * len(rows)))


def _notable(records: Sequence[Record]) -> Iterator[Event]:
    for record in records:
        if isinstance(record, _NOTABLE) and (text := event_line(record)):
            yield Event(record.t_ns, record.node, text)


def _broken(records: Sequence[Record]) -> Iterator[Event]:
    """The first deliveries that came later than the bound of their packet."""
    bounds: dict[tuple[int, int], int] = {}
    excluded: set[tuple[int, int, int]] = set()
    count = 0
    for record in records:
        if isinstance(record, BoundStated):
            bounds[record.node, record.seq] = record.bound_ns
        elif isinstance(record, BoundExcludes):
            excluded.add((record.node, record.seq, record.other))
        elif isinstance(record, Delivered) and count < _MOST_BROKEN:
            bound_ns = bounds.get((record.origin, record.seq))
            meant = (record.origin, record.seq, record.node) not in excluded
            if bound_ns is not None and meant and record.delay_ns > bound_ns:
                count += 1
                late_ms = (record.delay_ns - bound_ns) / MS
                name = f"packet {record.seq} of UAV {record.origin}"
                text = f"broken bound: {name}, {late_ms:.0f} ms late at UAV {record.node}"
                yield Event(record.t_ns, record.node, text)
