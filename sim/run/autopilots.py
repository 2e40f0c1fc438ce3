"""A world of flight controllers: each UAV of a swarm is at the end of a MAVLink connection, simulated or real."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Final

from fanet_mw.autopilot.link import AutopilotLink
from fanet_mw.autopilot.serving import Autopilot, serve_world
from fanet_mw.flavors import Flavor
from fanet_mw.gateway.gateway import per_uav
from fanet_mw.geodesy import Geodetic
from fanet_mw.hosts.clock import START_PATIENCE_S, ClockListener, SwarmClock
from fanet_mw.hosts.loop import heeding
from fanet_mw.hosts.readiness import tell_ready
from fanet_mw.scenario.fingerprint import fingerprint
from fanet_mw.units import NodeId
from sim.observation.bus_feed import BusFeed
from sim.world.environment.layout import positions

WORLD: Final = "world"
_LOOK_S: Final = 0.2


async def run(
    endpoint: str,
    swarm: str | None,
    connection: str,
    *,
    flavor: Flavor,
    zenoh_config: Path | None,
    tell: Callable[[str], None],
) -> int:
    """Play the world of a swarm until its time is over or a signal comes; returns the exit code."""
    over = asyncio.Event()
    per_uav(connection, 1, flag="--autopilots")
    with BusFeed(endpoint, swarm, zenoh_config=zenoh_config, name=WORLD) as feed, heeding(lambda _: over.set()):
        bus, names, scenario = feed.bus, feed.names, feed.scenario
        listener = ClockListener(bus, names)
        origin = Geodetic(*scenario.world.origin_deg, 0.0)
        clock: SwarmClock | None = None

        def now_ns() -> int:
            return 0 if clock is None else max(0, clock.now_ns())

        autopilots = {
            NodeId(node): Autopilot(
                f"UAV {node}", AutopilotLink(flavor=flavor, origin=origin),
                per_uav(connection, node, flag="--autopilots"), now_ns=now_ns, tell=tell,
            )
            for node in scenario.uav_ids
        }  # fmt: skip
        post = scenario.post
        standing = {} if post is None else {post: positions(scenario)[post - 1]}
        for autopilot in autopilots.values():
            await autopilot.connection.open()
        serving = asyncio.ensure_future(serve_world(bus, names, autopilots, standing, now_ns=now_ns))
        try:
            if not await _all_heard(autopilots, over, serving, tell):
                return 0
            bus.announce(names.alive(WORLD, fingerprint=fingerprint(scenario), instance="autopilots"))
            tell_ready()
            if (clock := await _started(listener, over, serving)) is None:
                return 0
            while not over.is_set() and not listener.stopped.is_set() and not serving.done():
                if clock.wait_s(clock.ends_ns or scenario.duration_ns) <= 0:
                    break
                await asyncio.sleep(_LOOK_S)
            if serving.done():
                serving.result()
        finally:
            serving.cancel()
            for autopilot in autopilots.values():
                autopilot.connection.close()
    return 0


async def _started(listener: ClockListener, over: asyncio.Event, serving: "asyncio.Future[None]") -> SwarmClock | None:
    """The swarm's clock once it runs; None if somebody ends the wait."""
    starting = asyncio.ensure_future(listener.running(timeout_s=START_PATIENCE_S))
    ended = asyncio.ensure_future(over.wait())
    try:
        await asyncio.wait((starting, ended, serving), return_when=asyncio.FIRST_COMPLETED)
        if serving.done():
            serving.result()
        return starting.result() if starting.done() else None
    finally:
        starting.cancel()
        ended.cancel()


async def _all_heard(
    autopilots: dict[NodeId, Autopilot],
    over: asyncio.Event,
    serving: "asyncio.Future[None]",
    tell: Callable[[str], None],
) -> bool:
    """Wait until every flight controller has said where it is; False if somebody ends the wait."""
    looks = 0
    while not over.is_set() and not serving.done():
        missing = [node for node, autopilot in autopilots.items() if autopilot.link.position is None]
        if not missing:
            return True
        looks += 1
        if looks % 25 == 0:
            some = ", ".join(map(str, missing[:8])) + (" .." if len(missing) > 8 else "")
            tell(f"waiting for a position of {len(missing)} of {len(autopilots)} flight controllers: {some}")
        await asyncio.sleep(_LOOK_S)
    if serving.done():
        serving.result()
    return False
