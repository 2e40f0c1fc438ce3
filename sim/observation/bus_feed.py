"""Hears a running swarm on its bus, as one more listener, and tells an observer what it hears.

    bus threads   each put is kept, as bytes, in a bounded queue; a full one loses the oldest, which is counted
    `pump`        decodes and checks what has come, on the caller's thread, and hands it to the observer

What roles UAVs took before it came it learns from their reports.
"""

import time
from collections import deque
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

from fanet_mw.bus import codecs
from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import (
    CameraImage,
    ClockEpoch,
    ClockState,
    MavlinkTap,
    Message,
    Poses,
    Report,
    TraceBatch,
    TxRequest,
)
from fanet_mw.bus.topics import Topics, node_of, node_of_tap
from fanet_mw.errors import ConfigError, FanetError, MalformedFrameError
from fanet_mw.hosts.bus import Bus, config_of
from fanet_mw.hosts.clock import SwarmClock
from fanet_mw.hosts.readiness import tell_ready
from fanet_mw.scenario import Scenario, config
from fanet_mw.scenario.fingerprint import told_by
from fanet_mw.trace import Record
from sim.bus.operator_commands import OPERATOR, find_swarm, first_answer
from sim.observation.observer import Observer
from sim.observation.turns import MOST_SPANS
from sim.records.bus_checks import BusChecks
from sim.records.standing import KINDS
from sim.records.told_faults import ToldFaults

_MOST_PUTS: Final = 50_000
_ANSWER_S: Final = 3.0
_ASK_CLOCK_S: Final = 1.0
_STANDING_S: Final = 1.0
"""How long it is waited for the answer how things stand; where nobody collects, none comes."""


class _Put(NamedTuple):
    topic: str
    payload: bytes


class BusFeed:
    """What is heard of one swarm; a context manager that ends its session."""

    def __init__(
        self,
        endpoint: str,
        swarm: str | None,
        *,
        zenoh_config: Path | None = None,
        name: str = OPERATOR,
        scenario: Scenario | None = None,
    ) -> None:
        """`scenario`: of a swarm whose scenario names files, which the bus does not carry; `name`: of the certificate.
        Raises BusError without a router, and FanetError without a swarm whose clock's keeper answers.
        """
        self.bus = Bus.join(endpoint, config_of(zenoh_config, name))
        try:
            self.names = Topics(swarm or find_swarm(self.bus))
            self.scenario = scenario or self._ask_scenario()
        except BaseException:
            self.bus.close()
            raise
        self.clock: SwarmClock | None = None
        self.time_scale = self.scenario.time_scale
        self.over = False
        """True once the swarm's time is over, or its clock was stopped."""
        self.lost = self.refused = 0
        """Puts that came faster than they were taken, and items that were refused."""
        self.images: dict[int, CameraImage] = {}
        """The last image of each UAV's camera, where the scenario has images rendered."""
        self._checks = BusChecks(self.scenario)
        self._stands: bytes | None = None
        self._waits_until_s = 0.0
        self._before: set[Record] = set()
        """The records of that answer, until what was put meanwhile has been told."""
        self._faults = ToldFaults()
        self._puts: deque[_Put] = deque(maxlen=_MOST_PUTS)
        self._clocks: deque[bytes] = deque(maxlen=16)
        self._asked_s = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.bus.close()

    def listen(self, *, catches_up: bool = False) -> None:
        """Begin to hear; `catches_up`: first of all be told how things stand, by whoever collects, if anybody does."""
        for expression in (
            self.names.pose, self.names.all_traces, self.names.all_reports, self.names.radio_links,
            self.names.mavlink("*"),
        ):  # fmt: skip
            self.bus.subscribe(expression, self._keep)
        if self.scenario.sensors.image_hz:
            self.bus.subscribe(self.names.images, self._keep)
        if catches_up:
            self._waits_until_s = time.monotonic() + _STANDING_S
            self.bus.ask(self.names.standing, self._stand)
        self._ask_clock()
        tell_ready()

    def pump(self, observer: Observer) -> int:
        """Tell an observer what has come; returns the number of puts. Raises BusError when the router is gone."""
        self.bus.check()
        self.look()
        return self.drain(observer)

    def look(self) -> None:
        if time.monotonic() >= self._asked_s + _ASK_CLOCK_S:
            self._ask_clock()
        while self._clocks:
            self._follow(self._clocks.popleft())
        if self.clock is not None and self.clock.wait_s(self.scenario.duration_ns) <= 0:
            self.over = True

    def drain(self, observer: Observer) -> int:
        """Tell an observer what has come, whether the router is there or not; returns the number of puts."""
        if self._waits_until_s:
            if self._stands is None and time.monotonic() < self._waits_until_s:
                return 0  # what is put meanwhile comes after it
            self._waits_until_s = 0.0
            self._catch_up(observer)
        count = 0
        while self._puts:
            put = self._puts.popleft()
            count += 1
            try:
                messages = codecs.decode(put.payload)
            except MalformedFrameError:
                self.refused += 1
                continue
            for message in messages:
                self._take(put.topic, message, observer)
        return count

    def now_ns(self) -> int:
        """The swarm instant; 0 before its clock runs."""
        return min(max(0, self.clock.now_ns()), self.scenario.duration_ns) if self.clock else 0

    # --- parts ----------------------------------------------------------------------------------------------------

    def _keep(self, topic: str, payload: bytes) -> None:
        """Called on the bus's threads."""
        if len(self._puts) == _MOST_PUTS:
            self.lost += 1
        self._puts.append(_Put(topic, payload))

    def _take(self, topic: str, message: Message, observer: Observer) -> None:
        name = topic.rpartition("/")[2]
        match message:
            case Poses() if topic == self.names.pose and self._known(message):
                observer.take_poses(message)
            case TraceBatch() if name in self._checks.node_of:
                good = [record for record in message.records if self._checks.record(name, record) is None]
                self.refused += len(message.records) - len(good)
                observer.take_records(self._faults.fresh(record for record in good if record not in self._before))
            case Report() if name in self._checks.node_of and message.name == name:
                content, why = self._checks.report(name, message.json)
                if why is None and makes_sense(content):
                    observer.take_report(name, content, t_ns=message.t_ns)
                else:
                    self.refused += 1
            case LinkStats() if self._checks.links(message) is None:
                observer.take_links(message)
            case CameraImage() if len(message.rgb) == 3 * message.width * message.height:
                self.images[node_of(topic)] = message
            case MavlinkTap() if self._checks.tap(message) is None:
                observer.take_tap(node_of_tap(topic), message.t_ns, message.data)
            case _:
                self.refused += 1

    def _stand(self, _: str, payload: bytes) -> None:
        self._stands = payload

    def _catch_up(self, observer: Observer) -> None:
        """Tell what was collected before this observer came."""
        try:
            batches = codecs.decode(self._stands) if self._stands else []
        except MalformedFrameError:
            batches = []
        self._before = {
            record
            for batch in batches
            if isinstance(batch, TraceBatch)
            for record in batch.records
            if isinstance(record, KINDS) and self._checks.named(record) is None
        }
        observer.take_records(sorted(self._before, key=lambda record: record.t_ns))

    def _known(self, poses: Poses) -> bool:
        return all(1 <= node <= self.scenario.node_count for node in poses.ids) and all(
            abs(value) < 1e8 for value in poses.states
        )

    def _follow(self, payload: bytes) -> None:
        try:
            messages = codecs.decode(payload)
        except MalformedFrameError:
            return
        for message in messages:
            if isinstance(message, ClockEpoch):
                self.time_scale = message.time_scale
                self.over = self.over or message.state is ClockState.STOPPED
                if self.clock is None:
                    self.clock = SwarmClock(message)
                else:
                    self.clock.follow(message)

    def _ask_clock(self) -> None:
        self._asked_s = time.monotonic()
        self.bus.ask(self.names.clock, lambda _, payload: self._clocks.append(payload))

    def _ask_scenario(self) -> Scenario:
        answer = first_answer(self.bus, self.names.scenario, timeout_s=_ANSWER_S)
        if answer is None:
            raise FanetError(f"swarm {self.names.swarm}: nobody says within {_ANSWER_S:g} s which scenario it runs")
        try:
            tree = told_by(self.names.swarm, answer)
            del tree["modules"]
            return config.build(tree, source=f"swarm {self.names.swarm}", imports=False)
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            if isinstance(error, ConfigError):
                where = "; its files are not on the bus: say --scenario FILE" if "file" in str(error) else ""
                raise FanetError(f"{error}{where}") from error
            raise FanetError(f"swarm {self.names.swarm}: its scenario cannot be read: {error}") from error


def makes_sense(content: Mapping[str, Any]) -> bool:
    """False for a report whose slots, turns, role or queue are of a shape that no node of this project states."""
    from pydantic import ValidationError

    from sim.results.run_folder import SHOWN_REPORT

    if any(type(content.get(key) or 0) is not int for key in ("waiting", "head", "cluster")):
        return False
    try:
        SHOWN_REPORT.validate_python(content)
    except ValidationError:
        return False
    slots, turns = content.get("slots") or {}, content.get("turns") or {}
    few_slots = slots.get("period_ms", 0.0) <= MOST_SPANS * slots.get("slot_ms", 1.0)
    return few_slots and len(turns.get("own", ())) <= MOST_SPANS


class Paced:
    """Waits so that a loop runs at most so often a second of wall time."""

    def __init__(self, rate_hz: float) -> None:
        self._interval_s = 1 / rate_hz
        self._next_s = time.monotonic()

    def wait(self) -> None:
        self._next_s = max(self._next_s + self._interval_s, time.monotonic())
        time.sleep(max(0.0, self._next_s - time.monotonic()))


_MOST_FRAMES: Final = 20_000


class LiveFrames:
    """The frames as they come; those for which there is no time are skipped and counted."""

    def __init__(self) -> None:
        self.skipped = self.malformed = 0
        self.wanted = True
        """False: what comes is passed over."""
        self._puts: deque[tuple[str, bytes]] = deque(maxlen=_MOST_FRAMES)

    def keep(self, topic: str, payload: bytes) -> None:
        """Called on the bus's threads."""
        if self.wanted:
            self.skipped += len(self._puts) == _MOST_FRAMES
            self._puts.append((topic, payload))

    def take(self) -> Iterator[tuple[int, TxRequest]]:
        for _ in range(len(self._puts)):
            topic, payload = self._puts.popleft()
            try:
                messages = codecs.decode(payload)
            except MalformedFrameError:
                self.malformed += 1
                continue
            for message in messages:
                if isinstance(message, TxRequest):
                    yield node_of(topic), message
