"""The swarm clock of a real-time run: swarm instant = (clock - epoch) x scale, handed over and never derived anew.

The keeper fixes the epoch in unix time and in its machine's monotonic time. A process of the same machine, whenever it
starts, counts from the monotonic epoch: they agree to microseconds, and no step of the system's clock moves any of
them. A process of another machine reads its unix time once, when it starts, and carries it on by its own monotonic
clock: it is right as far as the two machines' unix clocks agreed with each other at the epoch and at its start.
"""

import asyncio
import contextlib
import math
from collections.abc import Iterable, Sequence
from typing import Final

from fanet_mw.bus import topics
from fanet_mw.bus.messages import Clock, ClockState
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError, MalformedFrameError
from fanet_mw.hosts.bus import Bus, HostBus
from fanet_mw.hosts.timebase import THIS_MACHINE, Timebase
from fanet_mw.units import MS, S

_START_DELAY_NS: Final = 300 * MS
"""From the moment all are there until swarm instant 0."""
_ASK_EVERY_S: Final = 0.5
_ASK_AGAIN_S: Final = 0.05
"""Between two questions to the keeper of whoever hears of a change."""
START_PATIENCE_S: Final = 3600.0
"""For services that are started by hand, one after the other. A router that goes meanwhile is noticed in seconds."""


class SwarmClock:
    """Reads swarm instants."""

    def __init__(self, clock: Clock, timebase: Timebase = THIS_MACHINE) -> None:
        self.epoch_unix_ns = clock.epoch_unix_ns
        """Unix time of swarm instant 0."""
        self._mono_ns = timebase.mono_ns
        if clock.machine and clock.machine == timebase.machine:
            self._epoch_mono_ns = clock.epoch_mono_ns
        else:
            self._epoch_mono_ns = clock.epoch_unix_ns - (timebase.unix_ns() - timebase.mono_ns())
        self._scale = clock.time_scale

    def now_ns(self) -> int:
        """The swarm instant; negative before the start."""
        elapsed_ns = self._mono_ns() - self._epoch_mono_ns
        return elapsed_ns if self._scale == 1 else round(elapsed_ns * self._scale)

    def wait_s(self, instant_ns: int) -> float:
        """Wall seconds until a swarm instant; negative when it has passed."""
        return (instant_ns - self.now_ns()) / self._scale / S


def few(names: Sequence[str]) -> str:
    """The first five names of many."""
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


class ClockKeeper:
    """Starts the clock when all are there, answers whoever comes later, and stops it."""

    def __init__(
        self,
        bus: Bus,
        names: Topics,
        *,
        time_scale: float,
        expected: Iterable[str],
        timebase: Timebase = THIS_MACHINE,
    ) -> None:
        self._timebase = timebase
        self._bus = bus
        self._names = names
        self._time_scale = time_scale
        self._missing = {names.alive(name): name for name in expected}
        self._all_there = asyncio.Event()
        if not self._missing:
            self._all_there.set()
        self.clock: Clock | None = None
        loop = asyncio.get_running_loop()
        bus.answer(names.clock, self._current)

        def on_change(topic: str, alive: bool) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has been closed: nobody waits any more
                loop.call_soon_threadsafe(self._seen, topic, alive)

        bus.watch(names.all_alive, on_change)

    def _current(self) -> bytes | None:
        return topics.encode([self.clock]) if self.clock else None

    def _seen(self, topic: str, alive: bool) -> None:
        if alive:
            self._missing.pop(topic, None)
        if not self._missing:
            self._all_there.set()

    def missing(self) -> list[str]:
        """Who is not there yet."""
        return sorted(self._missing.values())

    async def start(self, *, timeout_s: float) -> Clock:
        """Wait for everyone, then start; raises BusError naming who did not come."""
        try:
            await asyncio.wait_for(self._all_there.wait(), timeout_s)
        except TimeoutError:
            names = self.missing()
            raise BusError(f"{len(names)} of the swarm did not come up within {timeout_s:g} s: {few(names)}") from None
        unix_ns = self._timebase.unix_ns() + _START_DELAY_NS
        mono_ns = self._timebase.mono_ns() + _START_DELAY_NS
        self._publish(Clock(unix_ns, self._time_scale, ClockState.RUNNING, mono_ns, self._timebase.machine))
        assert self.clock is not None, "just published"
        return self.clock

    def stop(self) -> None:
        """Everyone ends at once."""
        clock = self.clock or Clock(0, self._time_scale, ClockState.STOPPED)
        self._publish(clock._replace(state=ClockState.STOPPED))

    def _publish(self, clock: Clock) -> None:
        self.clock = clock
        self._bus.put(self._names.clock, topics.encode([clock]), reliable=True)


class ClockListener:
    """Hears the swarm clock, on the loop's thread.

    A put on the clock's topic may be anyone's, so it is a hint to ask the keeper, and only an answer counts: who has
    merely put a clock that is stopped has stopped nobody. Who also answers in the keeper's place does; an access list
    keeps others from that.
    """

    def __init__(self, bus: HostBus, names: Topics, timebase: Timebase = THIS_MACHINE) -> None:
        self._timebase = timebase
        self._bus = bus
        self._names = names
        self._loop = asyncio.get_running_loop()
        self._running: asyncio.Future[Clock] = self._loop.create_future()
        self.stopped = asyncio.Event()
        self._asked_s = -math.inf
        self._asks_again: asyncio.TimerHandle | None = None
        bus.subscribe(names.clock, self._hinted)

    def _hinted(self, _topic: str, _payload: bytes) -> None:
        """On the bus's thread: something was put on the clock's topic."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._ask)

    def _answered(self, _topic: str, payload: bytes) -> None:
        """On the bus's thread: the keeper has answered."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._heard, payload)

    def _ask(self) -> None:
        """Ask the keeper, at once or when the last question is old enough: a flood of hints is one question."""
        wait_s = self._asked_s + _ASK_AGAIN_S - self._loop.time()
        if wait_s <= 0:
            self._asked_s = self._loop.time()
            self._asks_again = None
            self._bus.ask(self._names.clock, self._answered)
        elif self._asks_again is None:
            self._asks_again = self._loop.call_later(wait_s, self._ask_now)

    def _ask_now(self) -> None:
        self._asked_s = -math.inf
        self._ask()

    def _heard(self, payload: bytes) -> None:
        try:
            messages = topics.decode(payload)
        except MalformedFrameError:
            return
        for message in messages:
            if isinstance(message, Clock):
                if message.state is ClockState.STOPPED:
                    self.stopped.set()
                if not self._running.done():
                    self._running.set_result(message)

    async def running(self, *, timeout_s: float) -> SwarmClock:
        """The clock, once it has started; raises BusError when nobody starts it or the router goes."""
        waited_s = 0.0
        while waited_s < timeout_s:
            self._ask_now()
            try:
                clock = await asyncio.wait_for(asyncio.shield(self._running), _ASK_EVERY_S)
                return SwarmClock(clock, self._timebase)
            except TimeoutError:
                waited_s += _ASK_EVERY_S
                self._bus.check()
        raise BusError(f"nobody started the swarm clock on {self._names.clock} within {timeout_s:g} s")
