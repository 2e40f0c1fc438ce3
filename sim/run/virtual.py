"""One scenario in virtual time: the same actors as in real time, in one process, deterministic."""

import gc
import os
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from signal import Signals
from typing import Any, Final

import numpy as np

from agents.clock.clocked_uav import make_uav
from emulator.medium import Medium
from emulator.pcap import Capture
from fanet_mw.actor import Actor
from fanet_mw.application import Application
from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import MavlinkTap, Message, Poses, Reception
from fanet_mw.bus.topics import Topics, node_of_tap
from fanet_mw.errors import HostError
from fanet_mw.hosts import interrupts
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.node.reader import Reader
from fanet_mw.part_failure import exits_raised, said_of
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.foreign_modules import modules_of
from fanet_mw.trace import Record
from fanet_mw.units import MS, NodeId, S
from sim.observation.observer import Observer
from sim.records.trace_log import TraceLog
from sim.results.clocks import true_delays
from sim.results.links import LinkTotals
from sim.results.outcome import Outcome
from sim.run.collecting.taps import TapLog
from sim.world.environment.layout import positions
from sim.world.environment.map_on_board import map_on_board
from sim.world.world import WorldActor

_EVERY_S: Final = 5.0
"""The CPU time of runs after which the garbage of them is collected [s]; that takes a tenth of a second."""


class GarbageOfRuns:
    """Collects what runs of this process leave behind (3 to 40 MB of 45 UAVs) between them: without the collector a run
    takes a tenth less time.
    """

    def __init__(
        self,
        *,
        every_s: float = _EVERY_S,
        collect: Callable[[], object] = gc.collect,
        cpu_s: Callable[[], float] = time.process_time,
    ) -> None:
        self._every_s = every_s
        self._collect = collect
        self._cpu_s = cpu_s
        self._uncollected_s = 0.0
        """The CPU time of the runs since the last collection."""

    @contextmanager
    def not_collected(self) -> Iterator[None]:
        """Collect the garbage of ended runs if it is time to; then switch the collector off, for one run."""
        if self._uncollected_s >= self._every_s:
            self._uncollected_s = 0.0
            self._collect()
        began_s, was_on = self._cpu_s(), gc.isenabled()
        gc.disable()
        try:
            yield
        finally:
            self._uncollected_s += self._cpu_s() - began_s
            if was_on and gc.get_freeze_count():  # what the program has frozen stays so
                gc.enable()
            elif was_on:
                gc.freeze()
                gc.enable()
                gc.unfreeze()  # all that is alive counts as old, so that the collector does not examine it at once


GARBAGE: Final = GarbageOfRuns()
"""That of this process: the collector is one for all runs in it."""


EPOCH_UNIX_NS: Final = 1_735_689_600 * S
"""2025-01-01T00:00:00Z: fixed, so that the same seed gives the same files; some tools take 1970 for no time at all."""
Applications = Callable[[int], Sequence[Application]]
"""A user's applications for each node."""

_STEP_NS: Final = 100 * MS
"""The time between two checks for signals. The result of a run does not depend on it."""


def actors_of(
    scenario: Scenario,
    swarm: str,
    *,
    capture: Capture | None = None,
    applications: Applications = lambda _: (),
) -> list[Actor]:
    """All actors of a swarm: the world comes first, so that poses are known before any node transmits."""
    starts, onboard_map, reader = positions(scenario), map_on_board(scenario), Reader()

    def uav(node: int) -> Actor:
        return make_uav(
            scenario,
            NodeId(node),
            swarm,
            position=starts[node - 1],
            applications=applications(node),
            onboard_map=onboard_map,
            reader=reader,
        )

    uavs = []
    for n in scenario.node_ids:
        stops = scenario.planned_stops(n)
        uavs.append(StoppableUav(partial(uav, n), stops) if stops else uav(n))
    return [WorldActor(scenario, swarm), Medium(scenario, swarm, capture=capture), *uavs]


def simulate(
    scenario: Scenario,
    *,
    on_progress: Callable[[float], None] = lambda _: None,
    capture: Capture | None = None,
    signals: Sequence[int] = (),
    applications: Applications = lambda _: (),
    spool_folder: Path | None = None,
    observer: Observer | None = None,
    on_failure: Callable[[BaseException, str], None] | None = None,
) -> Outcome:
    """Run a scenario to its end, or until `signals` holds the number of a signal; then the outcome is partial, or
    KeyboardInterrupt is raised before anything was simulated. `on_progress` is told the simulated seconds, `on_failure`
    what a part has raised, which ends a run early, and else is raised; a long run keeps what it collects in a nameless
    file in `spool_folder`.
    """
    with GARBAGE.not_collected(), _same_surroundings(), exits_raised():
        observed = Observed(
            scenario, capture=capture, applications=applications, folder=spool_folder, observer=observer
        )
        began = time.perf_counter()
        failure = None
        try:
            _run(observed, on_progress, signals)
        except Exception as error:
            if on_failure is None or not observed.host.now_ns or not observed.host.failed:
                raise
            failure = said_of(error, modules_of(scenario), observed.host.failed, now_ns=observed.host.now_ns)
            on_failure(error, failure)
            observed.host.stop_after_failure()
    interrupted = f"interrupted by {Signals(signals[0]).name}" if signals else ""
    return observed.outcome(wall_s=time.perf_counter() - began, cut_short=interrupted, failure=failure)


@contextmanager
def _same_surroundings() -> Iterator[None]:
    """Keep what a part of another package may change for all of the process: the working folder, so that relative paths
    stay what they were, the mode of new files, so that results can be read, and what warns or raises.
    """
    folder = os.open(".", os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    os.umask(mode := os.umask(0o077))
    try:
        with warnings.catch_warnings(), np.errstate():
            yield
    finally:
        os.umask(mode)
        os.fchdir(folder)
        os.close(folder)


class Observed:
    """The actors of a scenario on their host, and what is collected from them. The host refers to that, and this object
    does not, so it is freed with the outcome although the garbage collector is off in a run.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        capture: Capture | None = None,
        applications: Applications = lambda _: (),
        folder: Path | None = None,
        observer: Observer | None = None,
    ) -> None:
        """What is too long for memory is kept in a nameless file in `folder`."""
        self.scenario = scenario
        self.records = TraceLog(folder)
        self.names = Topics(scenario.name)
        self._taps = taps = TapLog(folder)
        self._links = links = LinkTotals()
        self._observer = observer
        self._reported_s = -1

        def tap(topic: str, message: Message) -> None:
            if isinstance(message, MavlinkTap):
                taps.append((message.t_ns, message.data))
                if observer is not None:
                    observer.take_tap(node_of_tap(topic), message.t_ns, message.data)

        def add_links(_: str, message: Message) -> None:
            if isinstance(message, LinkStats):
                links.add(message)
                if observer is not None:
                    observer.take_links(message)

        def see(_: str, message: Message) -> None:
            if isinstance(message, Poses) and observer is not None:
                observer.take_poses(message)

        records = self.records

        def take(some: list[Record]) -> None:
            records.extend(some)
            if observer is not None:
                observer.take_records(some)

        self.actors = actors_of(scenario, scenario.name, capture=capture, applications=applications)
        self.host = VirtualHost(
            self.actors,
            on_records=take,
            listeners=[
                (self.names.mavlink("*"), tap),
                (self.names.radio_links, add_links),
                *([] if observer is None else [(self.names.pose, see)]),
            ],
        )

    def tell_reports(self) -> None:
        """Hand the counters of all actors to the observer, at most once a second of swarm time."""
        now_ns = self.host.now_ns
        if self._observer is not None and now_ns // S > self._reported_s:
            self._reported_s = now_ns // S
            for actor in self.actors:
                self._observer.take_report(actor.name, actor.report(), t_ns=now_ns)

    def outcome(self, *, wall_s: float, cut_short: str, failure: str | None = None) -> Outcome:
        """The outcome, once the host was stopped; `cut_short` says why if that was before the end of the scenario, and
        `failure` what has ended it.
        """
        cut = failure is not None or self.host.now_ns < self.scenario.duration_ns
        return Outcome(
            scenario=self.scenario,
            mode="virtual",
            wall_s=wall_s,
            records=true_delays(self.records) if self.scenario.clock.modelled else self.records,
            reports={actor.name: actor.report() for actor in self.actors},
            taps=self._taps,
            links=self._links,
            epoch_unix_ns=EPOCH_UNIX_NS,
            ended=[(name, 1) for name in self.host.failed],
            aborted=(failure or cut_short) if cut else None,
            ended_ns=self.host.now_ns if cut else None,
        )


def _run(observed: Observed, on_progress: Callable[[float], None], signals: Sequence[int]) -> None:
    host, scenario = observed.host, observed.scenario
    if signals:
        raise KeyboardInterrupt(signals[0])
    try:
        host.start()
        for until_ns in range(_STEP_NS, scenario.duration_ns + _STEP_NS, _STEP_NS):
            host.run(min(until_ns, scenario.duration_ns))
            observed.tell_reports()
            on_progress(host.now_ns / S)
            if signals:
                break
        host.stop()
    except BaseException as error:
        if isinstance(error, Exception) or interrupts.is_signal(error):
            raise
        # else the process would end with exit code 0, as if there were a valid result, or as if a user had ended it
        did = f"called sys.exit({error.code!r})" if isinstance(error, SystemExit) else f"raised {type(error).__name__}"
        raise HostError(f"a part of another package has {did} at {host.now_ns / S:g} s") from error


class StoppableUav(Actor):
    """A UAV whose program ends at planned instants, and may be started again, as a process may; it knows nothing then.
    The counters of all its lives are summed up for the ledger.
    """

    def __init__(self, make: Callable[[], Actor], stops: Sequence[tuple[int, int | None]]) -> None:
        """`stops`: when the program ends, and when it is started again; None if it is not."""
        self._make = make
        self.alive: Actor | None = make()
        """The UAV while its program runs."""
        super().__init__(self.alive.name, self.alive.subscriptions)
        self._changes = [
            (at_ns, starts)
            for stop in stops
            for at_ns, starts in zip(stop, (False, True), strict=True)
            if at_ns is not None
        ]
        self._unheard = 0
        """The receptions that came while no program ran."""
        self._earlier: list[Mapping[str, Any]] = []
        """The reports of lives that are over."""

    def end_at(self, at_ns: int) -> None:
        """The program ends at this instant; nudge the UAV if it runs already."""
        self._changes.insert(0, (at_ns, False))

    def start(self, now_ns: int) -> None:
        assert self.alive is not None, "it lives at first"
        self._enter(self.alive)
        self.alive.start(now_ns)

    def _enter(self, uav: Actor) -> None:
        uav.outbox, uav.records = self.outbox, self.records

    def receive(self, topic: str, message: Message, now_ns: int) -> bool | None:
        if self.alive is None:
            self._unheard += isinstance(message, Reception)
            return True
        return self.alive.receive(topic, message, now_ns)

    def wake(self, now_ns: int) -> None:
        while self._changes and self._changes[0][0] <= now_ns:
            _, starts = self._changes.pop(0)
            if not starts and self.alive is not None:
                self.alive.stop(now_ns)
                self._earlier.append(self.alive.report())
                self.alive = None
            elif starts and self.alive is None:
                self.alive = self._make()
                self._enter(self.alive)
                self.alive.start(now_ns)
        if self.alive is not None:
            due_ns = self.alive.next_wake_ns()
            if due_ns is not None and due_ns <= now_ns:
                self.alive.wake(now_ns)

    def next_wake_ns(self) -> int | None:
        own = [self._changes[0][0]] if self._changes else []
        due_ns = None if self.alive is None else self.alive.next_wake_ns()
        return min([*own, *([] if due_ns is None else [due_ns])], default=None)

    def due(self, now_ns: int) -> Sequence[str]:
        return () if self.alive is None else self.alive.due(now_ns)

    def nudge(self, now_ns: int) -> None:
        if self.alive is not None:
            self.alive.nudge(now_ns)

    def stop(self, now_ns: int) -> None:
        if self.alive is not None:
            self.alive.stop(now_ns)

    def report(self) -> Mapping[str, Any]:
        lives = [*self._earlier, *([] if self.alive is None else [self.alive.report()])]
        summed: dict[str, Any] = dict(lives[-1])
        summed["receptions"] = summed.get("receptions", 0) + self._unheard
        for life in lives[:-1]:
            for key in ("frames_sent", "receptions", "generated"):
                summed[key] = summed.get(key, 0) + life.get(key, 0)
            for key in ("dropped", "messages"):
                counts = Counter(summed.get(key, {}))
                counts.update(life.get(key, {}))
                summed |= {key: dict(counts)} if counts else {}
        return summed
