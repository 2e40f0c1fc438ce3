"""A medium that cannot keep up: what it cannot take is counted, the others are served, and it ends on time."""

import asyncio
import json
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

from test_air_control import emulator

from emulator.medium import ANNOUNCED, Medium
from fanet_mw.actor import Actor
from fanet_mw.bus import codecs
from fanet_mw.bus.messages import MavlinkTap, Message, Report, TxOutcome, TxRequest, TxStatus
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import Bus
from fanet_mw.hosts.clock import ClockKeeper
from fanet_mw.hosts.inbox import BOUND
from fanet_mw.hosts.realtime import RealtimeHost
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, S
from sim.run.launcher.swarm import free_endpoint

NAMES = Topics("flood")
FLOODED = 20_000
"""Requests of one node within a second of swarm time: more than any node of ours asks for."""
FLOOD = """
import sys, time
from fanet_mw.bus import codecs
from fanet_mw.hosts.bus import Bus
from fanet_mw.bus.messages import TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.units import BROADCAST
with Bus.join(sys.argv[1]) as bus:
    topic, began_ns, count = Topics("flood").radio_tx(1), int(sys.argv[2]), int(sys.argv[3])
    for seq in range(count - 1):  # one every 50 us of swarm time, less than any radio needs for a frame
        request = TxRequest(seq, began_ns + seq * 50_000, b"flood", BROADCAST, wants_status=False)
        bus.put(topic, codecs.encode([request]))
    time.sleep(1)  # the bus has room again
with Bus.join(sys.argv[1]) as bus:  # another session, on which nothing waits: this one arrives, and shows what did not
    bus.put(topic, codecs.encode([TxRequest(count - 1, 0, b"flood", BROADCAST, wants_status=False)]), reliable=True)
    time.sleep(0.2)
"""


async def test_a_flood_from_one_node_is_counted_leaves_the_others_alone_and_ends_on_time() -> None:
    reports: list[bytes] = []
    async with emulator("flood", reports) as (endpoint, clock):
        with Bus.join(endpoint) as bus:
            command = [sys.executable, "-c", FLOOD, endpoint, str(clock.now_ns() + 500 * MS), str(FLOODED)]
            flood = subprocess.Popen(command)  # noqa: ASYNC220  (it returns at once)
            try:
                calm = 0
                while flood.poll() is None:
                    request = TxRequest(calm, clock.now_ns() + 30 * MS, b"calm", BROADCAST, wants_status=False)
                    bus.put(NAMES.radio_tx(2), codecs.encode([request]))
                    calm += 1
                    await asyncio.sleep(0.05)
            finally:
                flood.kill()
                flood.wait()
            asked = FLOODED + calm
            for _ in range(140):  # seconds of it wait in the bus
                await asyncio.sleep(0.5)
                if reports and told(reports)["frames"]["sent"] == asked:
                    break
    report = told(reports)
    assert report["final"], "the clock's stop is heard through the flood: the end of the run is far away"
    frames, host = report["frames"], report["host"]
    assert frames["sent"] == asked == frames["delivered"] + frames["in_flight"] + sum(frames["dropped"].values())
    assert host["samples"] == host["taken"] + host["malformed"] + host["overflowed"] + host["waiting"]
    assert host["taken"] == asked - frames["dropped"].get("bus", 0), "what bus or inbox dropped is the gap in requests"
    assert sum(frames["dropped"].get(reason, 0) for reason in ("bus", "late", "backlog", "mac_queue_full")) > asked / 2


async def test_a_host_that_is_held_up_drops_what_its_inbox_cannot_hold_and_says_so() -> None:
    """The loop does nothing while 3,000 requests of one node and ten of another come."""
    reports: list[bytes] = []
    arrived: list[str] = []
    async with emulator("flood", reports) as (endpoint, clock):
        with Bus.join(endpoint) as bus, Bus.join(endpoint) as other:
            other.subscribe(NAMES.radio_tx(1), lambda topic, _: arrived.append(topic))
            await asyncio.sleep(0.3)
            start_ns = clock.now_ns() + 30 * S

            def put(node: int, seq: int) -> None:
                request = TxRequest(seq, start_ns, b"x", BROADCAST, wants_status=False)
                bus.put(NAMES.radio_tx(node), codecs.encode([request]), reliable=True)

            for seq in range(3000):
                put(1, seq)
                if seq % 300 == 0:
                    put(2, seq // 300)
            while len(arrived) < 3000:
                time.sleep(0.01)  # noqa: ASYNC251  (holding up the loop is the test)
            time.sleep(0.2)  # noqa: ASYNC251  (as long again for the emulator's own session)
            for _ in range(10):  # the emulator lives on this loop, and has room again
                await asyncio.sleep(0.05)
            put(1, 3000)
            await asyncio.sleep(0.5)
    report = told(reports)
    host, dropped = report["host"], report["frames"]["dropped"]
    assert host["overflowed"] >= 3000 - BOUND // 4 - 300, "a share of the inbox is what one node has of it"
    assert dropped["bus"] >= host["overflowed"]
    assert report["frames"]["sent"] == 3011
    assert host["taken"] == 3011 - dropped["bus"]


def told(reports: list[bytes]) -> dict[str, Any]:
    """The last report."""
    (last,) = codecs.decode(reports[-1])
    assert isinstance(last, Report)
    content: dict[str, Any] = json.loads(last.json)
    return content


def test_a_node_that_announces_without_end_is_held_to_its_bound(make_scenario: Callable[..., Scenario]) -> None:
    medium = Medium(make_scenario(**{"nodes.count": 2, "radio.queue_frames": 10}), "flood")
    medium.start(0)
    bound = 10 + ANNOUNCED
    for seq in range(bound + 5):
        medium.receive(NAMES.radio_tx(1), TxRequest(seq, 30 * S, b"later", BROADCAST, wants_status=True), 0)
    medium.receive(NAMES.radio_tx(2), TxRequest(0, 10 * MS, b"now", BROADCAST, wants_status=True), 0)
    refused = [message for _, message in medium.outbox if isinstance(message, TxStatus)]
    assert [status.seq for status in refused] == list(range(bound, bound + 5))
    assert {status.outcome for status in refused} == {TxOutcome.QUEUE_FULL}
    medium.outbox.clear()
    medium.wake(29 * S)
    assert [m.outcome for _, m in medium.outbox if isinstance(m, TxStatus)] == [TxOutcome.SENT], "the other goes"
    medium.stop(40 * S)
    frames = medium.report()["frames"]
    assert frames["dropped"]["backlog"] == 5
    assert frames["in_flight"] == 0
    medium.receive(NAMES.radio_tx(1), TxRequest(bound + 5, 41 * S, b"again", BROADCAST, wants_status=False), 40 * S)
    assert medium.report()["frames"]["in_flight"] == 1, "its room is free again"


class Drowning(Actor):
    """Hears a message for every message it has heard, for ever; wakes every 20 ms."""

    def __init__(self) -> None:
        super().__init__("drowning", (NAMES.pose,))
        self.again: Callable[[], None] = lambda: None
        self.next_ns = 0
        self.wakes = 0
        self.heard = 0

    def start(self, now_ns: int) -> None:
        self.again()

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        self.heard += 1
        self.again()

    def wake(self, now_ns: int) -> None:
        self.wakes += 1
        self.next_ns = now_ns + 20 * MS

    def next_wake_ns(self) -> int | None:
        return self.next_ns


async def test_input_without_end_keeps_nobody_from_its_timers_nor_from_its_end() -> None:
    endpoint = free_endpoint()
    actor, put = Drowning(), codecs.encode([MavlinkTap(0, b"")])
    with Bus.serve(endpoint) as bus, Bus.join(endpoint) as own:
        host = RealtimeHost(actor, own, NAMES)
        actor.again = lambda: host._from_thread(NAMES.pose, put)
        keeper = ClockKeeper(bus, NAMES, time_scale=1.0, expected=["drowning"])
        running = asyncio.create_task(host.run(until_ns=1000 * MS, clock_timeout_s=60))
        await keeper.start(timeout_s=60)
        await asyncio.wait_for(running, 60)
    assert actor.heard > 1000
    assert actor.wakes > 8
