"""A swarm of real processes: router and clock in this one; the emulator, the world and each UAV in one of their own.

    start all -> wait until all are present -> start the clock -> collect traces, reports and taps -> all end -> outcome
                                               (and slow it down, if that is allowed, while the machine cannot keep up)

A signal ends the swarm early, at an instant that all are told a second before, so that the partial result closes. If
the process of a UAV dies, the others go on; a run needs the emulator and the world. With `respawn` any process is
started again, and continues by the clock.
"""

import asyncio
import contextlib
import os
import signal
import socket
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import ClockEpoch, ClockRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError, HostError, MalformedFrameError
from fanet_mw.hosts import interrupts
from fanet_mw.hosts.bus import Bus, config_of, with_port
from fanet_mw.hosts.clock import ClockKeeper, SwarmClock
from fanet_mw.hosts.loop import heeding
from fanet_mw.hosts.presence import expected_names, few
from fanet_mw.hosts.realtime import SwarmAddress
from fanet_mw.hosts.service import BUS_EXIT_CODE
from fanet_mw.routing import module_of
from fanet_mw.scenario import Scenario
from fanet_mw.trace import ProcessEnded, ProcessStarted
from fanet_mw.units import MS, S
from sim.bus.rights import ROUTER
from sim.bus.running_swarms import registered
from sim.results.outcome import Outcome, described
from sim.run.collecting.collector import Collector
from sim.run.collecting.running_tally import Progress
from sim.run.launcher import limits
from sim.run.launcher.child_processes import Processes, end_if_imported_by_a_child
from sim.run.launcher.clock_governor import ClockGovernor, Instant
from sim.run.launcher.leads import Leads
from sim.run.launcher.pauses import PauseWatch, processors
from sim.run.launcher.services import Services
from sim.world.flight_recorder import FlightRecorder
from sim.world.possible_world import require_possible

_MAX_LATE_STARTS: Final = 3
"""How often a process that has found no router may be started again before the swarm's time begins."""
_MAX_RESPAWNS: Final = 5
"""How often a process may be started again, so that one that cannot live is not started for ever."""


class Deaths:
    """The processes that died during one run, and which of them may be started again."""

    def __init__(self, *, respawn: bool) -> None:
        self.ended: list[tuple[str, int]] = []
        """Name and exit code of each process that died, in order."""
        self.records: list[ProcessEnded | ProcessStarted] = []
        """The same as trace records, and which of them were started again."""
        self._respawn = respawn
        self._respawns: Counter[str] = Counter()
        self._late_starts: Counter[str] = Counter()

    def grant_late_start(self, name: str, exit_code: int) -> bool:
        """True if a process that has found no router may be started again before the swarm's time begins."""
        if exit_code != BUS_EXIT_CODE or self._late_starts[name] >= _MAX_LATE_STARTS:
            return False
        self._late_starts[name] += 1
        return True

    def note(self, name: str, exit_code: int, *, node: int, now_ns: int) -> None:
        """A process has died; `node` is its UAV, or 0 for the emulator and the world."""
        self.ended.append((name, exit_code))
        self.records.append(ProcessEnded(now_ns, node, name, exit_code))

    def has_died(self, name: str) -> bool:
        return any(ended == name for ended, _ in self.ended)

    def note_start(self, name: str, *, node: int, now_ns: int) -> None:
        """A process was started again, perhaps one that has died."""
        if self.has_died(name):
            self.records.append(ProcessStarted(now_ns, node, name))

    def grant_respawn(self, name: str) -> bool:
        """True if a process that has died may be started again."""
        self._respawns[name] += 1
        return self._respawn and self._respawns[name] <= _MAX_RESPAWNS


READY_TIMEOUT_S: Final = 300.0
"""Until all processes are present: 47 take a minute on a busy machine, and a compilation may come on top."""
WORD_EVERY_S: Final = 10.0
"""The interval at which the launcher says for which processes it is waiting."""
_GRACE_S: Final = 5.0
"""How long the launcher waits for last reports after the end of the swarm's time."""
_LAST_WORDS_S: Final = 1.0
"""After the end of all processes: some last messages may still be on the bus."""
_PROGRESS_S: Final = 0.25
_LISTENS_S: Final = 0.05
"""The interval at which it is asked who does not listen yet."""
_SILENT_S: Final = 4
"""A process that has sent no report for so long is named; it sends one each second."""
_SILENT_TIMES: Final = 2
Tell = Callable[[str], None]
OnProgress = Callable[[Progress], None]


def free_endpoint(protocol: str = "tcp") -> str:
    """An endpoint on the loopback interface with a port that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"{protocol}/127.0.0.1:{probe.getsockname()[1]}"


class SwarmRun:
    """One run in real time."""

    def __init__(
        self,
        services: Services,
        bus: Bus,
        *,
        respawn: bool,
        tell: Tell,
        spool_folder: Path | None = None,
        slow_down_to: float | None = None,
        leads: Leads | None = None,
        awaited: Callable[[], Sequence[str]] = tuple,
        patient: bool = True,
    ) -> None:
        scenario, self.address = services.scenario, services.address
        names = Topics(self.address.swarm)
        self._services = services
        self._leads = leads
        self._awaited = awaited
        """Names the programs beside the swarm that are not ready yet, for which the clock waits."""
        self._tell = tell
        self._patient = patient
        """False: nobody is there who could end the one of two programs that are the same node."""
        self._collector = Collector(scenario, bus.subscribe, names, now_ns=time.monotonic_ns, folder=spool_folder)
        bus.answer(names.standing, self._collector.standing)
        self._recorder = FlightRecorder(scenario, bus.subscribe, names) if respawn else None
        self._keeper = ClockKeeper(
            bus, names, time_scale=scenario.time_scale, expected=expected_names(scenario), scenario=scenario
        )
        self._governor = ClockGovernor(
            scenario.time_scale,
            least=scenario.time_scale if slow_down_to is None else slow_down_to,
            late_limit=scenario.radio.late_limit,
            end_ns=scenario.duration_ns,
            processors=processors(),
        )
        protocol = module_of(scenario.routing.protocol)
        self.processes = Processes(self._process_ended, title=f"fanet {names.swarm}", preload=[protocol])
        self._deaths = Deaths(respawn=respawn)
        self._pauses = PauseWatch()
        self._program_changes = sorted(
            (at_ns, f"agent-{node}", starts)
            for node in scenario.node_ids
            for stop in scenario.planned_stops(node)
            for at_ns, starts in zip(stop, (False, True), strict=True)
            if at_ns is not None
        )
        """When the programs of UAVs end and are started again, by the scenario's faults."""
        self._stopped: set[str] = set()
        """The processes that do not run now because of that."""
        self._silent: dict[str, int] = {}
        """How often in a row each process has been found silent: a launcher that stood still finds all so, once."""
        self._asked: deque[float] = deque(maxlen=16)
        """The paces that operators have asked for, not yet heeded."""
        bus.subscribe(names.clock_control, self._on_pace)
        self._clock: SwarmClock | None = None
        self._over = asyncio.Event()
        self._ending = False
        self._aborted: str | None = None
        self._broken = False
        """True if the run was ended because the swarm cannot go on, not even to an end in good order."""
        self._signal: int | None = None

    async def run(self, on_progress: OnProgress, on_started: Callable[["SwarmRun"], None]) -> Outcome:
        """Start, run and collect; whatever happens, no process and no temporary file is left."""
        with contextlib.closing(self._collector), contextlib.closing(self._pauses):
            began = time.monotonic()
            try:
                if await self.processes.warm_up():
                    from emulator.compile_kernel import COMPILING_NOTICE  # with numba, which nothing else needs here

                    self._tell(COMPILING_NOTICE)
                self._check_not_over()
                on_started(self)
                await self._start_all()
                ready_s = await self._start_clock(began)
                run_began = time.monotonic()
                await self._follow(on_progress)
                ended_ns = None if self._aborted is None else await self._end_early()
                wall_s = time.monotonic() - run_began
                await self._wind_up()
            finally:
                self._over.set()
                self._ending = True
                await self.processes.end_all()
            return self._outcome(wall_s=wall_s, ready_s=ready_s, ended_ns=ended_ns)

    def _outcome(self, *, wall_s: float, ready_s: float, ended_ns: int | None) -> Outcome:
        """The outcome with what was collected; an incomplete trace is reported."""
        heard = self._collector.outcome(
            self._deaths.records,
            wall_s=wall_s,
            ready_s=ready_s,
            epoch_unix_ns=self._clock.epoch_unix_ns if self._clock else 0,
        )
        if (failure := self._collector.disk_failure()) is not None:
            self._tell(f"the trace is incomplete: its temporary file could not be written: {failure}")
        foreign = set() if self._services.own_world else {"world"}
        return replace(
            heard,
            ended=self._deaths.ended,
            aborted=self._aborted,
            ended_ns=ended_ns,
            absent={name: why for name, why in heard.absent.items() if name not in foreign},
            slowed=self._governor.steps,
            stall_ms=self._pauses.longest_ns / MS,
            pauses=self._pauses.summary(),
            leads=self._leads._asdict() if self._leads else {},
        )

    def interrupt(self, number: int) -> None:
        self._signal = number
        self.end(f"interrupted by {signal.Signals(number).name}")

    def end(self, why: str) -> None:
        """End the run early because somebody wants it."""
        nothing = "" if self._clock else " before the swarm's time began: there is no result"
        self.abort(f"{why}{nothing}")

    def abort(self, why: str, *, broken: bool = False) -> None:
        """End the run early; what has been collected becomes a partial result. A `broken` swarm is stopped at once."""
        if self._aborted is None and not self._over.is_set():
            self._aborted, self._broken = why, broken
            self._tell(why)
        self._over.set()

    async def _start_all(self) -> None:
        for name, entry, arguments, gives_way in self._services.each():
            self.processes.start(name, entry, arguments, gives_way=gives_way)
            await asyncio.sleep(0)  # lets signals be handled between the starts of many processes
            self._check_not_over()

    def _check_not_over(self) -> None:
        """Raise if the swarm was told to end before its time began, because then there is nothing to report."""
        if self._signal is not None:
            raise interrupts.said(self._signal)
        if self._over.is_set():
            raise BusError(self._aborted or "ended before the swarm was up")

    async def _start_clock(self, began: float) -> float:
        """Wait for all processes, then start the clock; returns how long that took [s]."""
        start = asyncio.ensure_future(self._start_once_heard())
        over = asyncio.ensure_future(self._over.wait())
        while not await _any_done(start, over, timeout_s=WORD_EVERY_S):
            presence, expected = self._keeper.presence, expected_names(self._services.scenario)
            if presence.complete():
                self._tell(f"waiting for {', '.join(self._awaited())}")
            else:
                self._tell(f"waiting for {len(presence.missing())} of {len(expected)}: {presence.sentence()}")
            if not self._patient and presence.twice():
                self.abort(f"{presence.sentence()}; leave_out names the nodes that a program joins, each once")
        over.cancel()
        if not start.done():
            start.cancel()
            self._check_not_over()
        self._clock = SwarmClock(start.result())
        self._pauses.restart()
        self._collector.begin()
        ready_s = time.monotonic() - began
        self._tell(f"{len(self.processes.names())} processes up after {ready_s:.1f} s")
        return ready_s

    async def _start_once_heard(self) -> ClockEpoch:
        """Wait until all programs beside the swarm listen, who then miss nothing, then for all processes, and start."""
        until_s = time.monotonic() + READY_TIMEOUT_S
        while names := self._awaited():
            if time.monotonic() > until_s:
                raise BusError(f"{', '.join(names)} did not listen within {READY_TIMEOUT_S:g} s")
            await asyncio.sleep(_LISTENS_S)
        return await self._keeper.start(timeout_s=READY_TIMEOUT_S)

    async def _follow(self, on_progress: OnProgress) -> None:
        assert self._clock is not None, "the clock was started"
        while self._clock.wait_s(self._services.scenario.duration_ns) > 0 and not self._over.is_set():
            reports = self._collector.reports()
            self._heed_paces()
            self._govern(reports)
            self._name_silent()
            on_progress(self._progress(reports))
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._over.wait(), _PROGRESS_S)
            self._change_programs()

    def _name_silent(self) -> None:
        """Say which processes hang, or get no processor time; their run is not valid, but it would last to its end."""
        silent = self._collector.silent(_SILENT_S * S).intersection(self.processes.names())
        self._silent = {name: self._silent.get(name, 0) + 1 for name in silent}
        if found := sorted(name for name, times in self._silent.items() if times == _SILENT_TIMES):
            self._tell(f"at {self._now_ns() / S:.1f} s no report for {_SILENT_S} s: {few(found)}")

    def _change_programs(self) -> None:
        """End the programs of UAVs, and start them again, as the scenario plans it."""
        while self._program_changes and self._program_changes[0][0] <= self._now_ns() and not self._over.is_set():
            _, name, starts = self._program_changes[0]
            if starts and name in self._stopped and name in self.processes.names():
                return  # it has not ended yet
            del self._program_changes[0]
            if not starts and name in self.processes.names():
                self._stopped.add(name)
                os.kill(self.processes.pid(name), signal.SIGKILL)
            elif starts and name in self._stopped:
                self._tell(f"{name} is started again at {self._now_ns() / S:.1f} s, as planned")
                self._stopped.discard(name)
                self._start_again(name)

    def _on_pace(self, _topic: str, payload: bytes) -> None:
        """Called on a thread of the bus."""
        with contextlib.suppress(MalformedFrameError):
            asked = [one.time_scale for one in codecs.decode(payload) if isinstance(one, ClockRequest)]
            self._asked.extend(asked)

    def _heed_paces(self) -> None:
        """Let the clock run as an operator wants it to."""
        assert self._clock is not None, "the clock was started"
        while self._asked:
            scale = self._asked.popleft()
            self._governor.ask(scale, swarm_ns=self._now_ns())
            self._clock.follow(self._keeper.pace(scale))
            self._tell(f"at {self._now_ns() / S:.1f} s an operator set the swarm's clock to {scale:.3g}")

    def _govern(self, reports: Mapping[str, Mapping[str, Any]]) -> None:
        """Fit the pace of the clock to what the reports say of the machine."""
        assert self._clock is not None, "the clock was started"
        now_ns, before = self._now_ns(), self._governor.scale
        scale = self._governor.pace(reports, Instant(now_ns, time.monotonic_ns(), time.process_time()))
        if scale is None:
            return
        self._clock.follow(self._keeper.pace(scale))
        if scale < before:
            self._tell(f"the machine cannot keep up: at {now_ns / S:.1f} s the swarm's clock slows to {scale:.3g}")
        elif scale == self._services.scenario.time_scale:
            self._tell(f"at {now_ns / S:.1f} s the swarm's clock is back at {scale:.3g}")

    def _progress(self, reports: Mapping[str, Mapping[str, Any]]) -> Progress:
        scenario, tally = self._services.scenario, self._collector.tally
        late = reports.get("emulator", {}).get("late", {})
        return Progress(
            swarm_s=self._now_ns() / S,
            duration_s=scenario.duration_s,
            time_scale=self._governor.scale,
            delivered=tally.delivered_share(),
            late=late.get("late_frames", 0) / max(1, late.get("frames", 0)),
            confirmed=len(tally.confirmed),
            without_phone=len(tally.without_phone),
            survivors=scenario.mission.survivors,
        )

    async def _end_early(self) -> int:
        """Let the swarm end in a second, or stop it at once if it is broken; returns its last instant."""
        assert self._clock is not None, "the clock was started"
        if self._broken:
            return self._now_ns()
        return await self._keeper.end_early(self._clock, duration_ns=self._services.scenario.duration_ns)

    async def _wind_up(self) -> None:
        """End all processes, by the clock or by a signal, and wait for last reports."""
        self._over.set()
        await self._end_processes()
        dead = {name for name, _ in self._deaths.ended} | self._stopped
        dead |= set() if self._services.own_world else {"world"}
        end_s = time.monotonic() + _LAST_WORDS_S
        while self._collector.unfinished() - dead and time.monotonic() < end_s:  # noqa: ASYNC110  (other threads fill it)
            await asyncio.sleep(_LAST_WORDS_S / 20)

    async def _end_processes(self) -> None:
        if self._broken:
            self._keeper.stop()
        if not await self.processes.wait(_GRACE_S):
            late = self.processes.names()
            self._keeper.stop()
            if not await self.processes.wait(_GRACE_S / 2):
                self._tell(f"{len(late)} processes did not end by themselves: {', '.join(late[:5])}")

    def _process_ended(self, name: str, exit_code: int) -> None:
        if self._ending or (exit_code == 0 and (self._over.is_set() or self.time_is_over())):
            return
        if self._clock is None and not self._over.is_set() and self._deaths.grant_late_start(name, exit_code):
            self._tell(f"{name} ended with {described(exit_code)} before the start; started again")
            self._start_again(name)
            return
        if name in self._stopped:
            self._tell(f"{name} is stopped at {self._now_ns() / S:.1f} s, as planned")
            return
        now_ns = self._now_ns()
        node = _node_of(name)
        self._deaths.note(name, exit_code, node=node, now_ns=now_ns)
        what = f"{name} ended with {described(exit_code)} at {now_ns / S:.1f} s"
        if (server := self.processes.end_of_server(name)) is not None:
            what += f", with the server that all processes are forked from, which ended with {described(server)}"
        if self._over.is_set():
            self._broken |= not node
            self._tell(f"{what}, while the swarm was ending")
            return
        if self._deaths.grant_respawn(name):
            self._tell(f"{what}; started again")
            if name == "world" and self._recorder is not None:
                self._start_again(name, flight=self._recorder.last())
            else:
                self._start_again(name)
        elif node and self._clock is not None:
            self._tell(f"{what}; the others carry on")
        else:
            self.abort(f"{what}; the run cannot go on without it", broken=True)

    def _start_again(self, name: str, **more: object) -> None:
        """Start a process again. Where that fails, the swarm goes on without a UAV, and not without anything else."""
        try:
            self.processes.restart(name, **more)
            self._collector.begin(name)
            self._deaths.note_start(name, node=_node_of(name), now_ns=self._now_ns())
        except HostError as error:
            if not name.startswith("agent-") or self._clock is None:
                self.abort(f"{error}; the run cannot go on without it", broken=True)
                return
            if not self._deaths.has_died(name):  # it was stopped as planned
                self._deaths.note(name, -signal.SIGKILL, node=_node_of(name), now_ns=self._now_ns())
            self._tell(f"{error}; the others carry on")

    def _now_ns(self) -> int:
        """The swarm instant, limited to the swarm's time."""
        return min(max(0, self._clock.now_ns()), self._services.scenario.duration_ns) if self._clock else 0

    def time_is_over(self) -> bool:
        return self._clock is not None and self._clock.wait_s(self._services.scenario.duration_ns) <= 0.05


def _node_of(name: str) -> int:
    """The UAV whose process this is; 0 for the emulator and the world."""
    return int(name.removeprefix("agent-")) if name.startswith("agent-") else 0


async def _any_done(*futures: asyncio.Future[Any], timeout_s: float) -> bool:
    done, _ = await asyncio.wait(futures, timeout=timeout_s, return_when=asyncio.FIRST_COMPLETED)
    return bool(done)


def _bus(listen: str | None, connect: str | None, zenoh_config: Path | None) -> tuple[Bus, str]:
    """The launcher's session, and the endpoint for its children; TLS by default if there are keys for all."""
    config = config_of(zenoh_config, ROUTER)
    if connect is not None:
        return Bus.join(connect, config), connect
    keys_for_all = zenoh_config is not None and zenoh_config.is_dir()
    endpoint = with_port(listen) if listen else free_endpoint("tls" if keys_for_all else "tcp")
    return Bus.serve(endpoint, config), endpoint


async def launch(
    scenario: Scenario,
    *,
    swarm: str,
    listen: str | None = None,
    connect: str | None = None,
    respawn: bool = False,
    slow_down_to: float | None = None,
    own_world: bool = True,
    emulator_options: Mapping[str, Any] | None = None,
    spool_folder: Path | None = None,
    zenoh_config: Path | None = None,
    on_progress: OnProgress = lambda _: None,
    on_event: Tell = lambda _: None,
    on_started: Callable[[SwarmRun], None] = lambda _: None,
    leave_out: Collection[int] = (),
    heed_signals: bool = True,
    leads: Leads | None = None,
    awaited: Callable[[], Sequence[str]] = tuple,
) -> Outcome:
    """Run a scenario as real processes; `on_started` receives the swarm while it runs.

    `slow_down_to`: the scale to which the clock may slow down while the machine cannot keep up. Nodes of `leave_out`
    are joined by a program of the user's. Without `own_world` a foreign world declares the liveliness token of `world`.
    `leads`: what was chosen for the scenario, for the outcome. `awaited` names programs that are not ready; the clock
    waits until it names none. `zenoh_config`: a file for all processes, or a folder
    with one for each. Raises BusError when the swarm does not come up, ConfigError when the world is impossible or a
    limit too low, HostError when the program launches when it is imported, and KeyboardInterrupt for a signal before
    there is anything to report.
    """
    end_if_imported_by_a_child()
    require_possible(scenario)
    processes = len(expected_names(scenario))
    if (note := limits.many(processes=processes)) is not None:
        on_event(note)
    limits.prepare(processes=processes)
    bus, endpoint = _bus(listen, connect, zenoh_config)
    with bus, registered(swarm, endpoint) as known:
        if connect is not None and await asyncio.to_thread(bus.is_answered, Topics(swarm).scenario):
            raise BusError(f"swarm {swarm} is already served on {endpoint}: another name (--swarm) keeps the two apart")
        on_event(f"swarm {swarm} on {endpoint}" + ("" if known else "; other commands must be told so: --connect"))
        address = SwarmAddress(swarm, endpoint, zenoh_config, READY_TIMEOUT_S)
        services = Services(scenario, address, own_world, frozenset(leave_out), emulator_options or {})
        run = SwarmRun(
            services, bus, respawn=respawn, tell=on_event, spool_folder=spool_folder, slow_down_to=slow_down_to,
            leads=leads, awaited=awaited, patient=heed_signals,
        )  # fmt: skip
        with heeding(run.interrupt) if heed_signals else contextlib.nullcontext():
            return await run.run(on_progress, on_started)
