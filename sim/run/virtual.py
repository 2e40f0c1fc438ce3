"""One scenario in virtual time: the same actors as in real time, in one process, deterministic."""

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from signal import Signals
from typing import Final

from agents.clocked import make_uav
from emulator.medium import Medium
from emulator.pcap import Capture
from fanet_mw.actor import Actor
from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import MavlinkTap, Message
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from fanet_mw.units import MS, NodeId, S
from sim.results.clocks import true_delays
from sim.results.links import LinkTotals
from sim.run.outcome import Outcome
from sim.world.layout import positions
from sim.world.world import World

EPOCH_UNIX_NS: Final = 1_735_689_600 * S
"""2025-01-01T00:00:00Z, the instant of swarm instant 0 in logs that want unix time. It is not the time of the run, so
that the same scenario and seed give the same files; and it is not 1970, which some tools take for no time at all."""
_STEP_NS: Final = 100 * MS
"""The time between two checks for signals. How a run is divided into steps changes nothing in it."""


def actors_of(scenario: Scenario, swarm: str, *, capture: Capture | None = None) -> list[Actor]:
    """All actors of a swarm: the world first, so that there are poses before any node transmits."""
    starts = positions(scenario)
    uavs = [make_uav(scenario, NodeId(node), swarm, position=starts[node - 1]) for node in scenario.node_ids]
    return [World(scenario, swarm), Medium(scenario, swarm, capture=capture), *uavs]


def simulate(
    scenario: Scenario,
    *,
    on_progress: Callable[[float], None] = lambda _: None,
    capture: Capture | None = None,
    signals: Sequence[int] = (),
) -> Outcome:
    """Run a scenario to its end, or until `signals` holds a signal's number: then the outcome is what there is so far.

    `on_progress` receives the simulated seconds that have passed. Raises KeyboardInterrupt with the signal's number
    when the signal comes before anything has been simulated.
    """
    swarm = scenario.name
    records: list[Record] = []
    taps: list[tuple[int, bytes]] = []

    def tap(_: str, message: Message) -> None:
        if isinstance(message, MavlinkTap):
            taps.append((message.t_ns, message.data))

    links = LinkTotals()

    def add_links(_: str, message: Message) -> None:
        if isinstance(message, LinkStats):
            links.add(message)

    actors = actors_of(scenario, swarm, capture=capture)
    names = Topics(swarm)
    listeners = [(names.mavlink("*"), tap), (names.radio_links, add_links)]
    host = VirtualHost(actors, on_records=records.extend, listeners=listeners)
    began = time.perf_counter()
    with _no_collector():
        _run(host, scenario, on_progress, signals)
    interrupted = host.now_ns < scenario.duration_ns
    return Outcome(
        scenario=scenario,
        mode="virtual",
        wall_s=time.perf_counter() - began,
        records=true_delays(records) if scenario.clock.modelled else records,
        reports={actor.name: actor.report() for actor in actors},
        taps=taps,
        links=links,
        epoch_unix_ns=EPOCH_UNIX_NS,
        aborted=f"interrupted by {Signals(signals[0]).name}" if interrupted else None,
        ended_ns=host.now_ns if interrupted else None,
    )


def _run(host: VirtualHost, scenario: Scenario, on_progress: Callable[[float], None], signals: Sequence[int]) -> None:
    if signals:
        raise KeyboardInterrupt(signals[0])
    host.start()
    for until_ns in range(_STEP_NS, scenario.duration_ns + _STEP_NS, _STEP_NS):
        host.run(min(until_ns, scenario.duration_ns))
        on_progress(host.now_ns / S)
        if signals:
            break
    host.stop()


@contextmanager
def _no_collector() -> Iterator[None]:
    """Switch the garbage collector off: a run makes millions of small tuples and no cycles; this saves a tenth."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.freeze()
            gc.enable()
            gc.unfreeze()  # what the run has left counts as old, so that the collector does not walk through it at once
