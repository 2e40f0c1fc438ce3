"""`fanet router`: the bus and the swarm clock for services that are started one by one; on request it collects what
they do.
"""

import asyncio
import contextlib
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError
from fanet_mw.hosts.bus import Bus, config_of, with_port
from fanet_mw.hosts.clock import START_PATIENCE_S, ClockKeeper, SwarmClock
from fanet_mw.hosts.loop import heeding
from fanet_mw.hosts.presence import expected_names
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS
from sim.bus.rights import ROUTER
from sim.bus.running_swarms import registered
from sim.run.launcher.pauses import PauseWatch

if TYPE_CHECKING:
    from sim.results.outcome import Outcome
    from sim.run.collecting.collector import Collector

_STOP_HEARD_S: Final = 0.3
"""The time from telling services to stop until the bus is closed over which they are told."""
WORD_EVERY_S: Final = 5.0
"""The interval at which the router says which participants are missing or present twice."""
_LEAVING_S: Final = 1.0
"""How long the bus stays after the end of the swarm's time."""
_LAST_WORDS_S: Final = 3.0
"""How long the router waits after that for last reports."""
Tell = Callable[[str], None]


async def serve(
    scenario: Scenario,
    *,
    swarm: str,
    listen: str,
    on_event: Tell,
    on_begun: Callable[[], None] = lambda: None,
    out: Path | None = None,
    zenoh_config: Path | None = None,
) -> "Outcome | None":
    """Serve the bus and the clock, which `on_begun` is told of, until the scenario is over; with `out`, a folder for
    temporary files, return what the services did, also until a signal. Raises BusError when it cannot listen.
    """
    listen = with_port(listen)
    with contextlib.ExitStack() as held:
        bus = held.enter_context(Bus.serve(listen, config_of(zenoh_config, ROUTER)))
        held.enter_context(registered(swarm, listen))
        names, expected = Topics(swarm), expected_names(scenario)
        collector = None
        if out is not None:
            from sim.run.collecting.collector import Collector  # with numpy, which a router alone does not need

            collector = Collector(scenario, bus.subscribe, names, now_ns=time.monotonic_ns, folder=out)
            held.enter_context(contextlib.closing(collector))
            bus.answer(names.standing, collector.standing)
        keeper = ClockKeeper(bus, names, time_scale=scenario.time_scale, expected=expected, scenario=scenario)
        pauses = held.enter_context(contextlib.closing(PauseWatch()))
        on_event(f"serving {listen}, waiting for {len(keeper.missing())} services of swarm {swarm}")
        teller = asyncio.ensure_future(_say_who_is_missing(keeper, on_event))
        began_s = time.monotonic()
        try:
            running = await keeper.start(timeout_s=START_PATIENCE_S)
            clock, ran_s = SwarmClock(running), time.monotonic()
            pauses.restart()
            on_event("all are there: the clock runs")
            on_begun()
            signaled: asyncio.Future[int] = asyncio.get_running_loop().create_future()
            aborted, ended_ns = None, None
            with heeding(partial(_settle, signaled)) if collector else contextlib.nullcontext():
                await asyncio.wait([signaled], timeout=max(0, clock.wait_s(scenario.duration_ns)))
                teller.cancel()  # who leaves at the end is not missing
                if signaled.done():
                    aborted = f"interrupted by {signal.Signals(signaled.result()).name}"
                    on_event(aborted)
                    ended_ns = await keeper.end_early(clock, duration_ns=scenario.duration_ns)
                await asyncio.sleep(_LEAVING_S)
                if collector is not None:
                    await _last_words(collector)
        finally:  # no service may go on running on a bus that ends
            teller.cancel()
            keeper.stop()
            time.sleep(_STOP_HEARD_S)  # noqa: ASYNC251  (nothing else runs here, and a cancelled task cannot await)
        if collector is None:
            return None
        outcome = collector.outcome(
            wall_s=time.monotonic() - ran_s, ready_s=ran_s - began_s, epoch_unix_ns=running.epoch_unix_ns
        )
        stall_ms, paused = pauses.longest_ns / MS, pauses.summary()
        return replace(outcome, aborted=aborted, ended_ns=ended_ns, stall_ms=stall_ms, pauses=paused)


async def _last_words(collector: "Collector") -> None:
    """Wait until all actors have sent their last reports, but no longer than `_LAST_WORDS_S`."""
    end_s = time.monotonic() + _LAST_WORDS_S
    while collector.unfinished() and time.monotonic() < end_s:  # noqa: ASYNC110  (other threads fill it)
        await asyncio.sleep(0.05)


def _settle(signaled: asyncio.Future[int], number: int) -> None:
    if not signaled.done():
        signaled.set_result(number)


async def _say_who_is_missing(keeper: ClockKeeper, tell: Tell) -> None:
    """Say every few seconds which services are missing or present twice, before the start and during the run."""
    while True:
        await asyncio.sleep(WORD_EVERY_S)
        with contextlib.suppress(BusError):
            if said := keeper.presence.sentence():
                tell(said)
