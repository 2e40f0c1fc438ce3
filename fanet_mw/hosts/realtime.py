"""Real time: one actor on asyncio over Zenoh, under the same contract as in virtual time.

    Zenoh's thread -> inbox -> wake-ups of the loop drain it -> actor -> outbox, one put per topic and wake-up

An actor is never woken early. One with slack is woken with the next message after the instant it asked for, at the
latest when its slack is over: a wake-up of a process costs far more than what the actor does in it. Later wake-ups are
counted as late, one asked for in the past from the request on. An actor that raises ends its host, and with it the
process.
"""

import asyncio
import gc
import json
import secrets
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

from fanet_mw.actor import Actor, require_instant
from fanet_mw.bus import codecs
from fanet_mw.bus.messages import Message, Reception, Report, TraceBatch
from fanet_mw.bus.topics import ALL_SCENARIOS, Topics, swarm_of
from fanet_mw.errors import ConfigError
from fanet_mw.hosts.bus import JOIN_PATIENCE_S, Bus, HostBus, config_of
from fanet_mw.hosts.clock import START_PATIENCE_S, ClockListener, SwarmClock
from fanet_mw.hosts.inbox import Inbox
from fanet_mw.hosts.presence import few
from fanet_mw.hosts.timebase import THIS_MACHINE, Timebase
from fanet_mw.hosts.wake_lateness import ProcessCost, WakeLateness
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.fingerprint import differences, fingerprint, identity, told_by
from fanet_mw.trace import Record
from fanet_mw.units import S

_LOOK_EVERY_S: Final = 0.5
"""Records are published and the router is checked at this interval; a killed process loses the records of one."""
_ON_ITS_WAY_S: Final = 0.1
"""The medium waits so long at the end for requests that are on the bus; nodes wait twice that for its last copies."""
_LOOKS_PER_REPORT: Final = 2
_SCENARIO_S: Final = 1.0
"""A process waits so long to be told which scenario the swarm runs."""


class _WakeUp(NamedTuple):
    """A wake-up that the actor has requested, and the timer that is set for it."""

    asked_ns: int
    due_ns: int
    """From when the wake-up counts as late: the end of the slack, not before the call at which it was requested."""
    timer: asyncio.TimerHandle


class RealtimeHost:
    """Runs one actor until its swarm time is over."""

    def __init__(self, actor: Actor, bus: HostBus, names: Topics, timebase: Timebase = THIS_MACHINE) -> None:
        self._timebase = timebase
        self._actor = actor
        self._bus = bus
        self._names = names
        self._loop = asyncio.get_running_loop()
        self._inbox = Inbox()
        self._drain_asked = False
        self._failure: asyncio.Future[None] = self._loop.create_future()
        self._clock: SwarmClock | None = None
        self.running = False
        """True once the actor has been started, until it is called no more."""
        self._wake_up: _WakeUp | None = None
        self._call_ns = 0
        self._records: list[Record] = []
        self._told_other_swarm = False
        self._lateness = WakeLateness()
        self._cost = ProcessCost()

    async def run(
        self,
        *,
        until_ns: int,
        clock_timeout_s: float,
        scenario: Scenario | None = None,
        on_epoch: Callable[[int], None] = lambda _: None,
    ) -> None:
        """Declare, announce, wait for the clock, run, report. Raises BusError, what the actor raises, and ConfigError
        if the clock's keeper has another scenario. `on_epoch`: gets the unix time [ns] of swarm instant 0.
        """
        for expression in self._actor.subscriptions:
            self._bus.subscribe(expression, self._from_thread)
        listener = ClockListener(self._bus, self._names, self._timebase)
        await self._agree(scenario)
        own = fingerprint(scenario) if scenario is not None else ""
        self._bus.announce(self._names.alive(self._actor.name, fingerprint=own, instance=secrets.token_hex(4)))
        self._clock = await listener.running(timeout_s=clock_timeout_s)
        on_epoch(self._clock.epoch_unix_ns)
        await self._sleep_until(0)
        gc.freeze()  # what start-up has made stays alive: the collector need not examine it in the middle of a slot
        self.running = True
        try:
            self._call_ns = self.now_ns()
            self._actor.start(self._call_ns)
            self._publish_and_arm()
            self._drain()
            await self._watch(until_ns, listener)
        except BaseException:
            self._halt()
            self._publish_records()  # they show what led to the failure
            raise
        await self._finish(min(until_ns, self._clock.ends_ns or until_ns))

    async def _agree(self, scenario: Scenario | None) -> None:
        """Ask the keeper which scenario the swarm runs; one that does not answer is content with any."""
        if scenario is None:
            return
        answer: asyncio.Future[bytes] = self._loop.create_future()

        def on_answer(_topic: str, payload: bytes) -> None:
            if not self._loop.is_closed():
                self._loop.call_soon_threadsafe(_settle, answer, payload)

        self._bus.ask(self._names.scenario, on_answer)
        try:
            theirs = told_by(self._names.swarm, await asyncio.wait_for(answer, _SCENARIO_S))
        except TimeoutError:
            self._bus.ask(ALL_SCENARIOS, self._tell_other_swarm)
            return
        except (ValueError, RecursionError):
            return
        found = list(differences(identity(scenario), theirs))
        if found:
            keys = few(f"{key} = {ours!r} here, {other!r} there" for key, ours, other in found)
            raise ConfigError(f"{self._actor.name} runs another scenario than swarm {self._names.swarm}: {keys}")

    def _tell_other_swarm(self, topic: str, _payload: bytes) -> None:
        """Called on the bus's thread: the router serves another swarm. It is no error, as ours may come later."""
        mine, theirs = self._names.swarm, swarm_of(topic)
        if not self._told_other_swarm and theirs.isprintable():
            self._told_other_swarm = True
            sys.stderr.write(
                f"{self._actor.name} waits for swarm {mine}, which nobody serves there; served is {theirs}. A swarm is "
                "named as its scenario, unless --swarm says otherwise\n"
            )

    def nudge(self) -> None:
        """Let the actor look now at what was given to it from outside, on this thread; nothing before it runs."""
        if self.running:
            self._guard(self._nudge_actor)

    def _nudge_actor(self) -> None:
        self._call_ns = self.now_ns()
        self._actor.nudge(self._call_ns)
        self._publish_and_arm()

    async def _sleep_until(self, instant_ns: int) -> None:
        assert self._clock is not None, "the clock is running"
        wait_s = self._clock.wait_s(instant_ns)
        if wait_s > 0:
            await asyncio.sleep(wait_s)

    async def _watch(self, until_ns: int, listener: ClockListener) -> None:
        """Publish records and reports until the time is over, the clock is stopped or the router is gone."""
        clock = self._clock
        assert clock is not None, "the clock is running"
        stopped, changed = (asyncio.ensure_future(event.wait()) for event in (listener.stopped, listener.changed))
        looks = 0
        try:
            while (left_s := clock.wait_s(min(until_ns, clock.ends_ns or until_ns))) > 0:
                wait_s, began_s = min(left_s, _LOOK_EVERY_S), self._loop.time()
                waited = (stopped, changed, self._failure)
                await asyncio.wait(waited, timeout=wait_s, return_when=asyncio.FIRST_COMPLETED)
                self._lateness.stalled(round((self._loop.time() - began_s - wait_s) * clock.time_scale * S))
                if self._failure.done():
                    break
                if stopped.done():
                    if listener.failure is not None:
                        raise listener.failure
                    return
                if changed.done():
                    listener.changed.clear()
                    changed = asyncio.ensure_future(listener.changed.wait())
                    self._set_timer()
                    continue
                self._bus.check()
                self._publish_records()
                looks += 1
                if looks % _LOOKS_PER_REPORT == 0:
                    self._publish_report(final=False)
        finally:
            stopped.cancel()
            changed.cancel()
        if self._failure.done():
            self._failure.result()

    def _halt(self) -> None:
        """Make no more calls of the actor from the loop."""
        self.running = False
        if self._wake_up is not None:
            self._wake_up.timer.cancel()
            self._wake_up = None

    async def _finish(self, until_ns: int) -> None:
        self._halt()
        now_ns = max(0, min(self.now_ns(), until_ns))
        await asyncio.sleep(_ON_ITS_WAY_S if self._actor.hears_out else 2 * _ON_ITS_WAY_S)
        while self._inbox.deliver(lambda topic, message: self._receive_last(topic, message, now_ns)):
            pass
        self._actor.stop(now_ns)
        self._publish_and_arm(rearm=False)
        self._publish_records()
        self._publish_report(final=True)

    def _receive_last(self, topic: str, message: Message, now_ns: int) -> None:
        """Count what was on its way at the end; an actor that accounts for it (`hears_out`) still receives it."""
        self._inbox.unread += isinstance(message, Reception)
        if self._actor.hears_out:
            self._actor.receive(topic, message, now_ns)

    # --- in -------------------------------------------------------------------------------------------------------

    def _from_thread(self, topic: str, payload: bytes) -> None:
        """Called on Zenoh's thread: many samples cause one wake-up of the loop."""
        self._inbox.offer(topic, payload)
        if self._drain_asked or self._loop.is_closed() or (topic in self._actor.patient and self._wakes_soon()):
            return
        self._drain_asked = True
        self._loop.call_soon_threadsafe(self._drain)

    def _wakes_soon(self) -> bool:
        """True if the actor will be woken within its slack, and takes what has come then."""
        wake_up = self._wake_up
        if not self.running or wake_up is None:
            return False
        return 0 < wake_up.due_ns - self.now_ns() <= self._actor.slack_ns

    def _drain(self) -> None:
        self._drain_asked = False
        if self.running:  # otherwise samples wait for the start, or come after the end
            self._guard(self._take_inbox)

    def _guard(self, step: Callable[[], None]) -> None:
        """Run a step; without this the loop would log an error and go on, with an actor that is never woken again."""
        try:
            step()
        except Exception as error:  # noqa: BLE001  (this is the outermost call of the actor; `_watch` raises the error)
            self._halt()
            if not self._failure.done():
                self._failure.set_exception(error)

    def _take_inbox(self) -> None:
        self._inbox.deliver(self._receive)
        if self._wake_up is not None and self._wake_up.asked_ns <= self.now_ns():
            self._wake_actor()
        else:
            self._publish_and_arm()

    def _receive(self, topic: str, message: Message) -> None:
        self._call_ns = self.now_ns()
        self._actor.receive(topic, message, self._call_ns)

    # --- time -----------------------------------------------------------------------------------------------------

    def now_ns(self) -> int:
        """The swarm instant; available only when the clock runs."""
        assert self._clock is not None, "the clock is running"
        return self._clock.now_ns()

    def _arm(self) -> None:
        wake_ns = self._actor.next_wake_ns()
        if self._wake_up is not None:
            if wake_ns == self._wake_up.asked_ns:
                return
            self._wake_up.timer.cancel()
            self._wake_up = None
        if wake_ns is None:
            return
        require_instant(wake_ns, who=self._actor.name)
        assert self._clock is not None, "the clock is running"
        self._lateness.asked(wake_ns, call_ns=self._call_ns)
        due_ns = max(wake_ns + self._actor.slack_ns, self._call_ns)
        timer = self._loop.call_later(self._clock.wait_s(due_ns), self._wake)
        self._wake_up = _WakeUp(wake_ns, due_ns, timer)

    def _set_timer(self) -> None:
        """Set the timer of the next wake-up again: at a faster clock it is due sooner."""
        wake_up, clock = self._wake_up, self._clock
        if wake_up is not None and clock is not None:
            wake_up.timer.cancel()
            timer = self._loop.call_later(clock.wait_s(wake_up.due_ns), self._wake)
            self._wake_up = wake_up._replace(timer=timer)

    def _wake(self) -> None:
        self._guard(self._wake_with_inbox)

    def _wake_with_inbox(self) -> None:
        self._inbox.deliver(self._receive)
        self._wake_actor()

    def _wake_actor(self) -> None:
        wake_up, now_ns = self._wake_up, self.now_ns()
        if wake_up is not None:
            wake_up.timer.cancel()
        self._wake_up = None
        if wake_up is not None and now_ns >= wake_up.asked_ns:  # else the loop's clock is a little fast: arm again
            self._lateness.woken(max(0, now_ns - wake_up.due_ns))
            self._call_ns = now_ns
            self._actor.wake(now_ns)
        self._publish_and_arm()

    # --- out ------------------------------------------------------------------------------------------------------

    def _publish_and_arm(self, *, rearm: bool = True) -> None:
        """Publish the actor's outbox, one put per topic, and set the timer for its next wake-up."""
        actor = self._actor
        if actor.outbox:
            by_topic: dict[str, list[Message]] = {}
            for topic, message in actor.outbox:
                by_topic.setdefault(topic, []).append(message)
            actor.outbox.clear()
            for topic, messages in by_topic.items():
                self._bus.put(topic, codecs.encode(messages))
            self._cost.puts += len(by_topic)
        if actor.records:
            self._records += actor.records
            actor.records.clear()
        if rearm:
            self._arm()
            if self._inbox.waiting and not self._drain_asked:  # timers, the clock and reports may run before
                self._drain_asked = True
                self._loop.call_soon(self._drain)

    def _publish_records(self) -> None:
        if self._records:
            batch = TraceBatch(tuple(self._records))
            self._records.clear()
            self._bus.put(self._names.trace(self._actor.name), codecs.encode([batch]), reliable=True)

    def _publish_report(self, *, final: bool) -> None:
        content = {
            **self._actor.report(),
            "final": final,
            "host": {**self._lateness.summary(), **self._cost.summary(final=final), **self._inbox.figures()},
        }
        report = Report(self._actor.name, self.now_ns(), json.dumps(content))
        self._bus.put(self._names.report(self._actor.name), codecs.encode([report]), reliable=True)


def _settle(answer: "asyncio.Future[bytes]", payload: bytes) -> None:
    if not answer.done():
        answer.set_result(payload)


class SwarmAddress(NamedTuple):
    """The address at which a process finds its swarm."""

    swarm: str
    endpoint: str
    """The Zenoh endpoint of its router."""
    zenoh_config: Path | None = None
    """Zenoh's own configuration: a file, or a folder with one file for each actor."""
    patience_s: float = JOIN_PATIENCE_S
    """The time for which a router that does not answer is tried."""


async def run_actor(
    actor: Actor,
    address: SwarmAddress,
    *,
    until_ns: int,
    scenario: Scenario | None = None,
    clock_timeout_s: float = START_PATIENCE_S,
    on_epoch: Callable[[int], None] = lambda _: None,
    timebase: Timebase = THIS_MACHINE,
) -> None:
    """Join a router, run one actor, leave. Raises BusError, and ConfigError if the swarm runs another scenario."""
    config = config_of(address.zenoh_config, actor.name)
    with await Bus.join_on_loop(address.endpoint, config, patience_s=address.patience_s) as bus:
        host = RealtimeHost(actor, bus, Topics(address.swarm), timebase)
        await host.run(until_ns=until_ns, clock_timeout_s=clock_timeout_s, scenario=scenario, on_epoch=on_epoch)
