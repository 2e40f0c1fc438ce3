"""The swarm clock of a real-time run: swarm instant = (clock - epoch) x scale, with an epoch that one keeper announces.

Processes of the keeper's machine count from its monotonic epoch; those of another machine read unix time once, when
they start, so they are as accurate as the two unix clocks agree. A change of pace is another epoch and scale that give
the same instant; who hears of it late stands still until that has come so far: swarm time never goes back.
"""

import asyncio
import contextlib
import math
from collections.abc import Iterable
from typing import Final

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import ClockEpoch, ClockState
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError, ConfigError, MalformedFrameError
from fanet_mw.hosts.bus import Bus, HostBus
from fanet_mw.hosts.presence import Presence
from fanet_mw.hosts.timebase import THIS_MACHINE, Timebase
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.fingerprint import as_json, fingerprint
from fanet_mw.units import MS, S

_START_DELAY_NS: Final = 300 * MS
"""The time from the moment at which all processes are present to swarm instant 0."""
_NOTICE_S: Final = 1.0
"""How long before its early end the swarm is told of it."""
_ASK_EVERY_S: Final = 0.5
_ASK_AGAIN_S: Final = 0.05
"""The least time between two queries to the keeper."""
_FAR_S: Final = 1.5
"""Two clocks that differ by this much do so not because a process or the bus stood still."""
START_PATIENCE_S: Final = 3600.0
"""How long a service started by hand waits for the others; it notices within seconds if the router goes away."""
_MOST_AHEAD_S: Final = 30 * 86400.0
"""The farthest that an epoch may lie ahead; one beyond it was probably given in another unit."""


def given_epoch_ns(epoch_unix_s: float, scenario: Scenario) -> int:
    """The epoch of a swarm without a keeper in ns; raises ConfigError if its time is over, or begins too far ahead."""
    now_s = THIS_MACHINE.unix_ns() / S
    if not -scenario.duration_s < epoch_unix_s - now_s < _MOST_AHEAD_S:
        raise ConfigError(
            f"epoch {epoch_unix_s:.15g}: by this machine's clock it is {now_s:.0f} now; the swarm's time must begin at "
            f"most {_MOST_AHEAD_S / 86400:g} days after that, and less than duration_s = {scenario.duration_s:g} before"
        )
    return round(epoch_unix_s * S)


def _is_of(clock: ClockEpoch, machine: int) -> bool:
    """True if the keeper's monotonic clock is that of this machine."""
    return clock.machine != 0 and clock.machine == machine


class SwarmClock:
    """The swarm instant as this process reads it."""

    def __init__(self, clock: ClockEpoch, timebase: Timebase = THIS_MACHINE) -> None:
        self.epoch_unix_ns = clock.epoch_unix_ns
        """The unix time of swarm instant 0."""
        self._mono_ns = timebase.mono_ns
        self._machine = timebase.machine
        self._unix_less_mono_ns = timebase.unix_ns() - timebase.mono_ns()
        self._epoch_mono_ns = self._on_this_machine(clock)
        self.time_scale = clock.time_scale
        """How many swarm seconds pass in a second of real time."""
        self._number = clock.number
        self._reached_ns = self._by_line_ns()
        """The clock does not go back behind this instant."""
        self.ends_ns = clock.ends_ns
        """The swarm instant at which all leave before the scenario is over; 0: nobody leaves early."""

    def _on_this_machine(self, clock: ClockEpoch) -> int:
        """The epoch on the monotonic clock of this machine."""
        if _is_of(clock, self._machine):
            return clock.epoch_mono_ns
        return clock.epoch_unix_ns - self._unix_less_mono_ns

    def follow(self, clock: ClockEpoch) -> bool:
        """Go on by what the keeper has announced; returns False for an announcement that is not newer."""
        if clock.number <= self._number:
            return False
        self._reached_ns = self.now_ns()
        self._number, self.time_scale, self.ends_ns = clock.number, clock.time_scale, clock.ends_ns
        self._epoch_mono_ns = self._on_this_machine(clock)
        return True

    def _by_line_ns(self) -> int:
        elapsed_ns = self._mono_ns() - self._epoch_mono_ns
        return elapsed_ns if self.time_scale == 1 else round(elapsed_ns * self.time_scale)

    def now_ns(self) -> int:
        """The swarm instant now; it is negative before the start."""
        now_ns = self._by_line_ns()
        return now_ns if now_ns > self._reached_ns else self._reached_ns

    def wait_s(self, instant_ns: int) -> float:
        """Seconds of real time until a swarm instant; negative when it has passed."""
        return (instant_ns - self._by_line_ns()) / self.time_scale / S


class ClockKeeper:
    """Starts the clock when all expected processes are present, answers those that come later, and stops it."""

    def __init__(
        self,
        bus: Bus,
        names: Topics,
        *,
        time_scale: float,
        expected: Iterable[str],
        scenario: Scenario | None = None,
        timebase: Timebase = THIS_MACHINE,
    ) -> None:
        """With a `scenario`, a process that runs another scenario does not count as present, and is told this one."""
        self._timebase = timebase
        self._bus = bus
        self._names = names
        self._time_scale = time_scale
        own = fingerprint(scenario) if scenario is not None else None
        self.presence = Presence(names, expected, fingerprint=own)
        self._all_there = asyncio.Event()
        if self.presence.complete():
            self._all_there.set()
        self.clock: ClockEpoch | None = None
        loop = asyncio.get_running_loop()
        bus.answer(names.clock, self._current)
        if scenario is not None:
            content = as_json(scenario).encode()
            bus.answer(names.scenario, lambda: content)

        def on_change(topic: str, alive: bool) -> None:
            with contextlib.suppress(RuntimeError):  # the loop may have been closed, and nobody waits any more
                loop.call_soon_threadsafe(self._seen, topic, alive)

        bus.watch(names.all_alive, on_change)

    def _current(self) -> bytes | None:
        return codecs.encode([self.clock]) if self.clock else None

    def _seen(self, topic: str, alive: bool) -> None:
        self.presence.on_token(topic, alive=alive)
        if self.presence.complete():
            self._all_there.set()
        else:
            self._all_there.clear()

    def missing(self) -> list[str]:
        """The processes that are not present yet."""
        return self.presence.missing()

    async def start(self, *, timeout_s: float) -> ClockEpoch:
        """Wait for all processes, then start the clock; raises BusError with the names of those that did not come."""
        try:
            await asyncio.wait_for(self._all_there.wait(), timeout_s)
        except TimeoutError:
            names, why = self.missing(), self.presence.sentence()
            raise BusError(f"{len(names)} of the swarm did not come up within {timeout_s:g} s: {why}") from None
        unix_ns = self._timebase.unix_ns() + _START_DELAY_NS
        mono_ns = self._timebase.mono_ns() + _START_DELAY_NS
        return self._publish(ClockEpoch(unix_ns, self._time_scale, ClockState.RUNNING, mono_ns, self._timebase.machine))

    def pace(self, time_scale: float) -> ClockEpoch:
        """Let swarm time pass at this scale from now on; every host follows as soon as it hears of it."""
        clock = self.clock
        assert clock is not None, "the clock runs"
        elapsed_ns = self._timebase.mono_ns() - clock.epoch_mono_ns
        later_ns = elapsed_ns - round(elapsed_ns * clock.time_scale / time_scale)
        unix_ns, mono_ns = clock.epoch_unix_ns + later_ns, clock.epoch_mono_ns + later_ns
        return self._publish(clock._replace(epoch_unix_ns=unix_ns, epoch_mono_ns=mono_ns, time_scale=time_scale))

    def end_at(self, instant_ns: int) -> ClockEpoch:
        """Let every process end in good order at this swarm instant, as at the end of the scenario."""
        clock = self.clock
        assert clock is not None, "the clock runs"
        return self._publish(clock._replace(ends_ns=instant_ns))

    async def end_early(self, clock: SwarmClock, *, duration_ns: int) -> int:
        """Let every process end in good order soon, and wait for it by `clock`; returns the last swarm instant."""
        assert self.clock is not None, "the clock runs"
        ends_ns = min(max(0, clock.now_ns()) + round(_NOTICE_S * self.clock.time_scale * S), duration_ns)
        clock.follow(self.end_at(ends_ns))
        await asyncio.sleep(clock.wait_s(ends_ns))
        return ends_ns

    def stop(self) -> None:
        """Stop the clock, so that every process ends at once."""
        clock = self.clock or ClockEpoch(0, self._time_scale, ClockState.STOPPED)
        self._publish(clock._replace(state=ClockState.STOPPED))

    def _publish(self, clock: ClockEpoch) -> ClockEpoch:
        numbered = clock._replace(number=clock.number + 1)
        self.clock = numbered
        self._bus.put(self._names.clock, codecs.encode([numbered]), reliable=True)
        return numbered


def _require_near(passed_s: float, *, most_s: float) -> None:
    """Raise BusError if this machine's clock gives an impossible time since swarm instant 0: the keeper tells of that
    instant shortly ahead, and it was at most `most_s` ago (infinite: not known).
    """
    behind_s, ahead_s = -passed_s - _START_DELAY_NS / S, passed_s - most_s
    for off_s, side in ((behind_s, "behind"), (ahead_s if math.isfinite(most_s) else 0.0, "ahead of")):
        if off_s > _FAR_S:
            raise BusError(
                f"the clock of this machine is {off_s:.1f} s {side} that of the swarm's: set both by GPS, PTP or NTP"
            )


class ClockListener:
    """Follows the swarm clock, on the event loop's thread. A put on its topic, where any process can put something, is
    only a hint to ask the keeper; an attacker who answers queries in its place is kept out by an access list.
    """

    def __init__(self, bus: HostBus, names: Topics, timebase: Timebase = THIS_MACHINE) -> None:
        self._timebase = timebase
        self._bus = bus
        self._names = names
        self._loop = asyncio.get_running_loop()
        self._running: asyncio.Future[SwarmClock] = self._loop.create_future()
        self._can_be_off = True
        """False for an epoch that all were given beforehand, and for one of this machine's own clock: if that was told
        late, the keeper stood still.
        """
        self._epochs: dict[int, int] = {}
        """The unix time [ns] of swarm instant 0 in each announcement, by its number."""
        self.failure: BusError | None = None
        """Why the clock counts as stopped although its keeper has not stopped it."""
        self.stopped = asyncio.Event()
        self.changed = asyncio.Event()
        """Set when the clock that runs has another pace or end than before; whoever waits for it clears it."""
        self._asked_s = -math.inf
        self._asks_again: asyncio.TimerHandle | None = None
        bus.subscribe(names.clock, self._on_hint)

    def _on_hint(self, _topic: str, _payload: bytes) -> None:
        """Called on the bus's thread when something was put on the clock's topic."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._ask)

    def _from_keeper(self, _topic: str, payload: bytes) -> None:
        """Called on the bus's thread when the keeper has answered."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._on_answer, payload)

    def _ask(self) -> None:
        """Query the keeper, at once or when the last query is old enough, so that many hints lead to one query."""
        wait_s = self._asked_s + _ASK_AGAIN_S - self._loop.time()
        if wait_s <= 0:
            self._asked_s = self._loop.time()
            self._asks_again = None
            self._bus.ask(self._names.clock, self._from_keeper)
        elif self._asks_again is None:
            self._asks_again = self._loop.call_later(wait_s, self._ask_now)

    def _ask_now(self) -> None:
        self._asked_s = -math.inf
        self._ask()

    def _on_answer(self, payload: bytes) -> None:
        try:
            messages = codecs.decode(payload)
        except MalformedFrameError:
            return
        for message in messages:
            if isinstance(message, ClockEpoch):
                if self._epochs.setdefault(message.number, message.epoch_unix_ns) != message.epoch_unix_ns:
                    self.failure = BusError(
                        f"the clock of swarm {self._names.swarm} was started anew: its router has been, or another "
                        "swarm on the same router has its name"
                    )
                if message.state is ClockState.STOPPED or self.failure is not None:
                    self.stopped.set()
                if self._running.done():
                    if self._running.result().follow(message):
                        self.changed.set()
                else:
                    self._can_be_off = message.epoch_mono_ns != 0 and not _is_of(message, self._timebase.machine)
                    self._running.set_result(SwarmClock(message, self._timebase))

    async def running(self, *, timeout_s: float) -> SwarmClock:
        """The clock, once it has started. Raises BusError if it does not start in time, the router goes away, or the
        clock of this machine is far from that of the keeper's.
        """
        waited_s, unanswered_s = 0.0, math.inf
        while waited_s < timeout_s:
            asked_s = self._loop.time()
            self._ask_now()
            try:
                clock = await asyncio.wait_for(asyncio.shield(self._running), _ASK_EVERY_S)
            except TimeoutError:
                waited_s, unanswered_s = waited_s + _ASK_EVERY_S, asked_s
                self._bus.check()
            else:
                if self._can_be_off:
                    _require_near(-clock.wait_s(0), most_s=self._loop.time() - unanswered_s)
                return clock
        raise BusError(f"nobody started the swarm clock on {self._names.clock} within {timeout_s:g} s")
