"""A finished run as `SwarmState` at any instant, forwards and back, from its trace, its telemetry and its recording.

Time goes forward by feeding records; every `_EVERY_NS` the state is kept, so that a jump back begins near its goal.
"""

import pickle
from array import array
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from fanet_mw.bus.link_stats import COUNTS, LinkStats
from fanet_mw.bus.messages import Poses
from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import open_regular
from fanet_mw.trace import (
    BoundStated,
    Collided,
    Confirmed,
    Delivered,
    FlightModeChanged,
    Posed,
    ProcessEnded,
    RadioFault,
    Record,
    Refuted,
    RoleChanged,
)
from fanet_mw.units import MS, US, S
from fanet_mw.wire import FOUND
from fanet_mw.wire.frame import message_id
from sim.observation.event_text import event_line
from sim.observation.swarm_state import Event, SwarmState
from sim.results.replay import Replay
from sim.results.run_folder import RunFolder

_EVERY_NS: Final = 10 * S
_TURNS: Final = ("slots", "turns")
_MOST_BROKEN: Final = 50
_NOTABLE: Final = (Confirmed, Refuted, RadioFault, ProcessEnded, Collided, FlightModeChanged, RoleChanged)


class Timeline:
    """One finished run."""

    def __init__(self, folder: Path) -> None:
        """Read the files of a run; raises ConfigError."""
        found = RunFolder(folder)
        self.scenario = found.scenario
        records: list[Record] = sorted(found.records(), key=lambda one: one.t_ns)  # some are of a little later
        self._replay = Replay(self.scenario, [one for one in records if isinstance(one, Posed)])
        self._posed = any(isinstance(one, Posed) for one in records)
        if not self._posed:
            raise ConfigError("the trace has no positions of UAVs (`posed`), so there is nothing to replay")
        self._records = [one for one in records if not isinstance(one, Posed)]
        self._finds = _finds(found, found.summary.get("epoch_unix_ns", 0))
        self._links = _links(folder, found.summary.get("epoch_unix_ns", 0))
        self.has_links = bool(self._links)
        """True if the folder has a recording, which tells what links carried each second."""
        self.end_ns = max(one.t_ns for one in records)
        self.events: Sequence[Event] = sorted([*_notable(self._records), *_broken(self._records)])
        self._start = SwarmState(self.scenario)
        for node, report in found.agents().items():
            told = {name: report[name] for name in _TURNS if report.get(name)}
            self._start.take_report(f"agent-{node}", {**told, "at_end": True}, t_ns=0)
        self._kept: list[tuple[int, tuple[int, int, int], bytes]] = []
        self.now_ns = 0
        self._next = (0, 0, 0)
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
        self._next = (0, 0, 0)
        self.state = pickle.loads(pickle.dumps(self._start))  # noqa: S301  (made by this object)
        self._pose(0)

    def _go_on(self, until_ns: int) -> None:
        """Feed what happened until an instant, second by second, so that trails and coverage are those of the run."""
        records, finds, links = self._next
        for second_ns in (*range(self.now_ns // S * S + S, until_ns, S), until_ns):
            end = bisect_right(self._records, second_ns, lo=records, key=lambda one: one.t_ns)
            self._pose(second_ns)
            self.state.take_records(self._records[records:end])
            records = end
            while finds < len(self._finds) and self._finds[finds][0] <= second_ns:
                self.state.take_tap(self._finds[finds][1], self._finds[finds][0], self._finds[finds][2])
                finds += 1
            while links < len(self._links) and self._links[links].t_ns <= second_ns:
                self.state.take_links(self._links[links])
                links += 1
        self.now_ns, self._next = until_ns, (records, finds, links)
        if until_ns % _EVERY_NS == 0 and (not self._kept or self._kept[-1][0] < until_ns):
            self._kept.append((until_ns, self._next, pickle.dumps(self.state)))

    def _pose(self, t_ns: int) -> None:
        now, before = self._replay.positions(t_ns / S), self._replay.positions(max(0.0, t_ns / S - 0.5))
        span_s = min(0.5, t_ns / S)
        states: list[float] = []
        for node, at in now.items():
            moved = at.minus(before[node])
            states += [*at, *((value / span_s if span_s else 0.0) for value in moved)]
        self.state.take_poses(Poses(t_ns, array("H", now), array("d", states)))


def _finds(folder: RunFolder, epoch_ns: int) -> list[tuple[int, int, bytes]]:
    """The finds of survivors in the telemetry: instant, UAV, frame."""
    return [
        (t_us * US - epoch_ns, frame[5], frame)
        for t_us, frame in folder.telemetry()
        if message_id(frame) == FOUND.msgid
    ]


def _links(folder: Path, epoch_ns: int) -> list[LinkStats]:
    """What links carried each second, from a recording in the folder; none without one, or without MCAP installed."""
    try:
        from google.protobuf.message import DecodeError
        from mcap.exceptions import McapError
        from mcap.reader import make_reader
        from mcap_protobuf.decoder import DecoderFactory
    except ImportError:
        return []
    found: list[LinkStats] = []
    for path in sorted(folder.glob("*.mcap")):
        try:
            with open_regular(path, follow=False) as file:
                reader = make_reader(file, decoder_factories=[DecoderFactory()])
                for _, _, message, links in reader.iter_decoded_messages(topics=["/links"]):
                    rows = [(link.src, link.dst, link.copies, link.received) for link in links.links]
                    found.append(_stats(message.log_time - epoch_ns, round(links.span_s * S), rows))
        except (McapError, DecodeError, OSError, ValueError, OverflowError) as error:
            raise ConfigError(f"{path}: cannot be read: {str(error)[:200]}") from error
    return found


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
    count = 0
    for record in records:
        if isinstance(record, BoundStated):
            bounds[record.node, record.seq] = record.bound_ns
        elif isinstance(record, Delivered) and count < _MOST_BROKEN:
            bound_ns = bounds.get((record.origin, record.seq))
            if bound_ns is not None and record.delay_ns > bound_ns:
                count += 1
                late_ms = (record.delay_ns - bound_ns) / MS
                text = f"broken bound: packet {record.seq} of UAV {record.origin}, {late_ms:.0f} ms late"
                yield Event(record.t_ns, record.node, text)
