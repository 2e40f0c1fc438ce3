"""The emulator on a frame's way, against a bare relay: `python tests/benchmarks/realtime_relay.py [RATE ...]`.

44 agent processes in 22 pairs, too far apart to hear each other. Each sends a frame to its partner over the emulator
and, just as often and in the same run, one over a process that does nothing but put what it receives on the partner's
topic.

    delay of the relay     = heard - put
    delay of the emulator  = heard - put - time on the air (its end minus the frame's arrival at the medium)

so both are two hops over the bus, with a Python process in between. The bare relay puts from Zenoh's own thread; the
emulator has its medium, its books and its timer in between.
"""

import asyncio
import struct
import sys
from collections.abc import Mapping
from typing import Any, Final

from emulator.process import run as run_emulator
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import MavlinkTap, Message, Reception, TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts import loop
from fanet_mw.hosts.bus import Bus
from fanet_mw.hosts.clock import ClockKeeper, ClockListener
from fanet_mw.hosts.realtime import SwarmAddress, run_actor
from fanet_mw.scenario import Scenario, config
from fanet_mw.units import MS, NodeId, S
from sim.run.launcher.child_processes import Processes
from sim.run.launcher.swarm import Collector, free_endpoint
from sim.world.process import run as run_world

NAMES: Final = Topics("relay")
PAIRS: Final = 22
RUN_S: Final = 12
WARM_S: Final = 3
SIZE: Final = 200
_STAMP: Final = struct.Struct("<Q")


def scenario() -> Scenario:
    places = [[1000.0 * (i // 2), 100.0 * (i % 2), 50.0] for i in range(2 * PAIRS)]
    return config.build(
        {
            "name": "relay", "duration_s": RUN_S, "clusters": {"count": 1},
            "nodes": {"count": 2 * PAIRS, "layout": "explicit", "positions_m": places, "telemetry_hz": 0},
            "world": {"area_m": 60_000}, "radio": {"late_limit": 1},
        }
    )  # fmt: skip


class Pinger(Actor):
    """Sends its partner a frame over either way in turn, and keeps how long those of the partner took."""

    def __init__(self, node: int, every_ns: int) -> None:
        super().__init__(f"agent-{node}", (NAMES.radio_rx(node), NAMES.mavlink(node)))
        self._node = node
        self._partner = NodeId(node + 1 if node % 2 else node - 1)
        self._every_ns = every_ns
        self._next_ns = 0
        self._seq = 0
        self._sent = 0
        self._delays: dict[str, list[int]] = {"emulator": [], "relay": []}

    def start(self, now_ns: int) -> None:
        self._next_ns = now_ns + self._every_ns * self._node // (2 * PAIRS)

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        if isinstance(message, Reception):
            (put_ns,) = _STAMP.unpack_from(message.frame)
            delay_ns = now_ns - put_ns - _AIR_NS
            way = "emulator"
        else:
            assert isinstance(message, MavlinkTap), "nothing else is said here"
            put_ns, delay_ns, way = message.t_ns, now_ns - message.t_ns, "relay"
        if put_ns > WARM_S * S:
            self._delays[way].append(delay_ns)

    def wake(self, now_ns: int) -> None:
        self._next_ns += self._every_ns
        self._sent += 1
        stamped = _STAMP.pack(now_ns) + bytes(SIZE - _STAMP.size)
        if self._sent % 2:
            request = TxRequest(self._seq, now_ns, stamped, self._partner, wants_status=False)
            self._seq += 1
            self.outbox.append((NAMES.radio_tx(self._node), request))
        else:
            self.outbox.append((f"fanet/relay/through/{self._partner}", MavlinkTap(now_ns, stamped)))

    def next_wake_ns(self) -> int | None:
        return self._next_ns

    def report(self) -> Mapping[str, Any]:
        return {"delays_ns": self._delays, "frames_sent": self._seq}


_AIR_NS: Final = 192_000 + -(-8 * (SIZE + 64) * 1000 // 11_000) * 1000 + 334
"""Airtime and propagation: the medium is idle, so the frame starts when it arrives."""


def ping(*, node: int, every_ns: int, endpoint: str) -> int:
    loop.run(run_actor(Pinger(node, every_ns), SwarmAddress("relay", endpoint), until_ns=RUN_S * S))
    return 0


def relay(*, endpoint: str) -> int:
    """The bare relay: no loop, no actor; a put per sample, on Zenoh's thread."""
    loop.run(_relay(endpoint))
    return 0


async def _relay(endpoint: str) -> None:
    with Bus.join(endpoint) as bus:
        outs = {f"fanet/relay/through/{node}": NAMES.mavlink(node) for node in range(1, 2 * PAIRS + 1)}
        bus.subscribe("fanet/relay/through/*", lambda topic, payload: bus.put(outs[topic], payload))
        listener = ClockListener(bus, NAMES)
        bus.announce(NAMES.alive("relay"))
        clock = await listener.running(timeout_s=60)
        await asyncio.sleep(clock.wait_s((RUN_S - 1) * S) + 1.5)


class Reports(Collector):
    """Only the reports of a swarm."""

    def __init__(self, bus: Bus) -> None:
        self._reports = {}
        bus.subscribe(NAMES.all_reports, self._reports.__setitem__)


async def measure(rate: float) -> dict[str, list[int]]:
    """Deliveries per second over each of the two ways; all delays."""
    chosen, endpoint = scenario(), free_endpoint()
    every_ns = round(S * 2 * PAIRS / (2 * rate))
    nodes = range(1, 2 * PAIRS + 1)
    with Bus.serve(endpoint) as bus:
        reports = Reports(bus)
        expected = ["emulator", "world", "relay", *(f"agent-{node}" for node in nodes)]
        keeper = ClockKeeper(bus, NAMES, time_scale=1.0, expected=expected)
        processes = Processes(lambda _name, _code: None)
        common = {"scenario": chosen, "address": SwarmAddress("relay", endpoint)}
        processes.start("emulator", run_emulator, common)
        processes.start("world", run_world, common)
        processes.start("relay", relay, {"endpoint": endpoint})
        for node in nodes:
            processes.start(f"agent-{node}", ping, {"node": node, "every_ns": every_ns, "endpoint": endpoint})
        await keeper.start(timeout_s=60)
        try:
            await processes.wait(RUN_S + 10)
        finally:
            await processes.end_all()
        delays: dict[str, list[int]] = {"emulator": [], "relay": []}
        for report in reports.reports().values():
            for way, found in report.get("delays_ns", {}).items():
                delays[way] += found
    return delays


def main(rates: list[float]) -> None:
    print("rate/s  way       deliveries  p50 ms  p99 ms     ratio of p50, p99")
    for rate in rates:
        delays = asyncio.run(measure(rate))
        figures = {}
        for way in ("relay", "emulator"):
            found = sorted(delays[way])
            figures[way] = [found[int(share * (len(found) - 1))] / MS for share in (0.5, 0.99)] if found else [0.0, 0.0]
            p50, p99 = figures[way]
            ratio = ""
            if way == "emulator":
                ratio = "  ".join(
                    f"{ours / theirs:.2f}" for ours, theirs in zip(figures[way], figures["relay"], strict=True)
                )
            print(f"{rate:6.0f}  {way:8}  {len(found):10}  {p50:6.2f}  {p99:6.2f}     {ratio}", flush=True)


if __name__ == "__main__":
    main([float(arg) for arg in sys.argv[1:]] or [675.0, 1350.0, 2700.0])
