"""The collector of a run in real time: it receives the traces, reports, taps and link statistics of the swarm's actors.

    put -> from a known actor? -> within its allowance? -> decoded -> each item valid? -> spool on disk, or last report
                                  items that fail a check are counted by what was wrong, and dropped

A put beyond the allowance is counted before it is decoded, so a flood of puts costs neither time nor disk space.
"""

import threading
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final

from fanet_mw.bus import codecs
from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import MavlinkTap, Message, Report, TraceBatch
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import MalformedFrameError
from fanet_mw.hosts.bus import OnSample
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from fanet_mw.units import S
from sim.records.bus_checks import BusChecks
from sim.records.spool import Spool
from sim.records.standing import Standing
from sim.records.stored_records import RecordSpools
from sim.records.told_faults import ToldFaults
from sim.results.links import LinkTotals
from sim.results.outcome import UNHEARD, Outcome
from sim.run.collecting.running_tally import RunningTally
from sim.run.collecting.taps import encoded_tap, taps_of

BURST_BYTES: Final = 16 << 20
"""The number of bytes that one actor may put at once; ten hours of a UAV's trace in `rescue`."""
BYTES_PER_S: Final = 1 << 20
"""In the long run, of one actor: two hundred times what a UAV in `rescue` puts."""
_LONGEST_WHY: Final = 120
Subscribe = Callable[[str, OnSample], None]


class Allowance:
    """A token bucket of bytes for each name."""

    def __init__(self, *, burst: int, per_s: int) -> None:
        self._burst = burst
        self._per_s = per_s
        self._left: dict[str, tuple[int, int]] = {}
        """The bytes left for each name, and the instant of that state."""

    def take(self, name: str, size: int, *, now_ns: int) -> bool:
        """True if this many bytes of this name may pass now."""
        left, then_ns = self._left.get(name, (self._burst, now_ns))
        left = min(self._burst, left + (now_ns - then_ns) * self._per_s // S)
        fits = size <= left
        self._left[name] = (left - size if fits else left, now_ns)
        return fits


class Collector:
    """Collects from one swarm. `now_ns` is a monotonic clock, `folder` the folder for temporary files."""

    def __init__(
        self, scenario: Scenario, subscribe: Subscribe, names: Topics, *, now_ns: Callable[[], int], folder: Path | None
    ) -> None:
        self._scenario = scenario
        self._checks = BusChecks(scenario)
        self._now_ns = now_ns
        self._lock = threading.Lock()  # Zenoh calls from several threads
        self._allowance = Allowance(burst=BURST_BYTES, per_s=BYTES_PER_S)
        self._records = RecordSpools(folder)
        self.tally = RunningTally(scenario)
        self._standing = Standing()
        self._faults = ToldFaults()
        self._taps = Spool(folder)
        self._reports: dict[str, dict[str, Any]] = {}
        self._links = LinkTotals()
        self._refused: Counter[str] = Counter()
        self._reported_ns: dict[str, int] = {}
        """When the last report of each actor was heard."""
        self._why_no_report: dict[str, str] = {}
        self._puts = 0
        for expression, what, take in (
            (names.all_traces, "trace", self._take_records),
            (names.all_reports, "report", self._take_report),
            (names.mavlink("*"), "telemetry", self._take_tap),
            (names.radio_links, "links", self._take_links),
        ):
            subscribe(expression, self._hearer(what, take))

    def standing(self) -> bytes:
        """The answer to an observer who asks how things stand."""
        with self._lock:
            return codecs.encode([TraceBatch(tuple(self._standing.records()))])

    # --- receiving, on threads of the bus -------------------------------------------------------------------------

    def _hearer(self, what: str, take: Callable[[str, Message], str | None]) -> OnSample:
        def hear(topic: str, payload: bytes) -> None:
            with self._lock:
                self._puts += 1
                why = self._hear(what, topic, payload, take)
                if why is not None:
                    self._refused[f"{what}: {why}"] += 1

        return hear

    def _hear(self, what: str, topic: str, payload: bytes, take: Callable[[str, Message], str | None]) -> str | None:
        """Handle one put; returns what was wrong with it, or with the last of its items that were wrong."""
        last = topic.rpartition("/")[2]
        name = {"telemetry": f"agent-{last}", "links": "emulator"}.get(what, last)
        if name not in self._checks.node_of:
            return "unknown actor"
        if not self._allowance.take(f"{what}/{name}", len(payload), now_ns=self._now_ns()):
            if what == "report":
                self._why_no_report[name] = (
                    f"of {len(payload):,} bytes; must be <= {BURST_BYTES:,} at once, {BYTES_PER_S:,} a second"
                )
            return "excess"
        try:
            messages = codecs.decode(payload)
        except MalformedFrameError:
            return "undecodable"
        wrong: str | None = None
        for message in messages:
            why = take(name, message)
            if why is not None:
                if wrong is not None:
                    self._refused[f"{what}: {wrong}"] += 1
                wrong = why
        return wrong

    def _take_records(self, name: str, message: Message) -> str | None:
        if not isinstance(message, TraceBatch):
            return "message type"
        good = []
        for record in message.records:
            why = self._checks.record(name, record)
            if why is None:
                good.append(record)
            else:
                self._refused[f"trace: {why}"] += 1
        good = self._faults.fresh(good)
        self._keep(good)
        self.tally.take_records(good)
        self._standing.take(good)
        return None

    def _keep(self, records: Iterable[Record]) -> None:
        """Write trace records; those for which the disk has no room are counted."""
        if lost := self._records.append(records):
            self._refused["trace: disk"] += lost

    def _take_report(self, name: str, message: Message) -> str | None:
        if not isinstance(message, Report):
            return "message type"
        if message.name != name:
            return "speaker"
        self._reported_ns[name] = self._now_ns()
        content, why = self._checks.report(name, message.json)
        if why is not None:
            self._why_no_report[name] = f"malformed: {why[:_LONGEST_WHY]}"
            return "shape"
        self._reports[name] = content
        return None

    def _take_tap(self, name: str, message: Message) -> str | None:
        if not isinstance(message, MavlinkTap):
            return "message type"
        why = self._checks.tap(message)
        if why is None and not self._taps.append(encoded_tap(message.t_ns, message.data)):
            return "disk"
        return why

    def _take_links(self, _name: str, message: Message) -> str | None:
        if not isinstance(message, LinkStats):
            return "message type"
        why = self._checks.links(message)
        if why is None:
            self._links.add(message)
        return why

    # --- results, when the run is over ----------------------------------------------------------------------------

    def outcome(
        self, further: Iterable[Record] = (), *, wall_s: float, ready_s: float = 0.0, epoch_unix_ns: int = 0
    ) -> Outcome:
        """The result of the run as far as it was received, with some further records."""
        with self._lock:
            self._keep(further)
            why = dict(sorted(self._refused.items()))
            absent = {
                name: self._why_no_report.get(name, UNHEARD)
                for name in self._checks.node_of
                if name not in self._reports or (name in self._why_no_report and not self._reports[name].get("final"))
            }
            return Outcome(
                scenario=self._scenario,
                mode="realtime",
                wall_s=wall_s,
                records=self._records.records(true_delays=self._scenario.clock.modelled),
                reports=self._sorted_reports(),
                taps=taps_of(self._taps),
                links=self._links,
                ready_s=ready_s,
                epoch_unix_ns=epoch_unix_ns,
                heard={"puts": self._puts, "malformed": sum(why.values()), "why": why},
                absent=absent,
            )

    def reports(self) -> dict[str, dict[str, Any]]:
        with self._lock:
            return self._sorted_reports()

    def _sorted_reports(self) -> dict[str, dict[str, Any]]:
        return dict(sorted(self._reports.items()))

    def unfinished(self) -> set[str]:
        """The actors that have not yet sent their last report."""
        with self._lock:
            return {name for name in self._checks.node_of if not self._reports.get(name, {}).get("final")}

    def begin(self, *names: str) -> None:
        """These actors, or all, are there now: their silence counts from here on."""
        with self._lock:
            self._reported_ns |= dict.fromkeys(names or self._checks.node_of, self._now_ns())

    def silent(self, for_ns: int) -> set[str]:
        """The actors that have sent no report for so long."""
        with self._lock:
            return {name for name, heard_ns in self._reported_ns.items() if self._now_ns() - heard_ns > for_ns}

    def disk_failure(self) -> str | None:
        """Why the trace or the taps are incomplete; None if both are complete."""
        return self._records.failure or self._taps.failure

    def close(self) -> None:
        with self._lock:
            self._records.close()
            self._taps.close()
