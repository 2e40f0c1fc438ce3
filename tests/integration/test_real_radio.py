"""Five UAV processes on real sockets, each in a network namespace of its own on one bridge: the same mission messages
arrive as in emulation. Needs the right to make namespaces; skipped, with the reason, where that is not given.
"""

import asyncio
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from fanet_mw.actor import Actor
from fanet_mw.bus import codecs
from fanet_mw.bus.messages import Message, TraceBatch, WifiScan
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import Bus
from fanet_mw.hosts.clock import ClockKeeper, SwarmClock
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.scenario import config
from fanet_mw.trace import Delivered, Generated, Record
from fanet_mw.units import MS, S
from sim.run.virtual import actors_of

COUNT = 5
PHONE = 3
SCENARIO = """
name = "field"
duration_s = 6
warmup_s = 2
drain_s = 1
[nodes]
count = 5
layout = "disc"
radius_m = 50
telemetry_hz = 0
[traffic]
interval_s = 1.0
payload_bytes = 500
[routing]
protocol = "flooding"
[clusters]
count = 1
[radio]
lead_ms = 100
[mission]
reports_to_approach = 3
"""


class Network(NamedTuple):
    """Namespaces joined by a bridge, with a subnet of their own: tests that run side by side share one route table."""

    names: list[str]
    prefix: str

    def address(self, node: int) -> str:
        return f"{self.prefix}.{node}"

    @property
    def bridge(self) -> str:
        return f"{self.prefix}.254"

    @property
    def broadcast(self) -> str:
        return f"{self.prefix}.255"


def sh(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True, text=True)


@pytest.fixture
def network() -> Iterator[Network]:
    """Five namespaces, addresses .1 to .5 of a /24 subnet, on a bridge with its address .254."""
    number = int.from_bytes(os.urandom(2)) % 2**14  # what is deleted lingers for a moment: no name and no subnet twice
    tag, prefix = f"fn{number}", f"10.{64 + (number >> 8)}.{number & 255}"
    network = Network([f"{tag}n{i}" for i in range(1, COUNT + 1)], prefix)
    bridge = f"{tag}b"
    try:
        try:
            sh("ip", "link", "add", bridge, "type", "bridge")
            sh("ip", "addr", "add", f"{network.bridge}/24", "dev", bridge)
            sh("ip", "link", "set", bridge, "up")
            for i, name in enumerate(network.names, start=1):
                own = f"{network.address(i)}/24"
                sh("ip", "netns", "add", name)
                sh("ip", "link", "add", f"{tag}v{i}", "type", "veth", "peer", "name", "wlan0", "netns", name)
                sh("ip", "link", "set", f"{tag}v{i}", "master", bridge, "up")
                sh("ip", "-n", name, "addr", "add", own, "broadcast", network.broadcast, "dev", "wlan0")
                sh("ip", "-n", name, "link", "set", "wlan0", "up")
        except (OSError, subprocess.CalledProcessError) as error:
            said = getattr(error, "stderr", "") or str(error)
            pytest.skip(f"network namespaces are not permitted here: {said.strip()}")
        yield network
    finally:
        for name in network.names:
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True)
        subprocess.run(["ip", "link", "del", bridge], check=False, capture_output=True)


def fly(network: Network, scenario: Path, *more: str) -> list[subprocess.Popen[str]]:
    return [
        subprocess.Popen(
            [
                "ip", "netns", "exec", name, sys.executable, "-m", "agents", str(scenario), "--id", str(node),
                "--radio-address", network.address(node), "--radio-broadcast", network.broadcast, *more,
            ],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )
        for node, name in enumerate(network.names, start=1)
    ]  # fmt: skip


def finished(processes: list[subprocess.Popen[str]]) -> list[dict[str, object]]:
    ended = [process.communicate(timeout=100) for process in processes]
    assert [process.returncode for process in processes] == [0] * COUNT, [err for _, err in ended]
    return [json.loads(out) for out, _ in ended]


def report_pairs(records: list[Record]) -> set[tuple[int, int]]:
    """(reporter, receiver) of survivor reports."""
    reports = {(r.node, r.seq) for r in records if isinstance(r, Generated) and r.app == "report"}
    return {(r.origin, r.node) for r in records if isinstance(r, Delivered) and (r.origin, r.seq) in reports}


def in_emulation(path: Path) -> set[tuple[int, int]]:
    """The same nodes, hearing the same phone at the same instant, over the emulated radio."""
    scenario = config.load(path)
    records: list[Record] = []
    names = Topics("field")
    host = VirtualHost([*actors_of(scenario, "field"), Phone(names)], on_records=records.extend)
    host.start()
    host.run(scenario.duration_ns)
    return report_pairs(records)


class Phone(Actor):
    """Lets nodes 1 to 3 hear a phone from 3 s on, one after the other: at one instant their reports would collide."""

    def __init__(self, names: Topics) -> None:
        super().__init__("phone", ())
        self._names = names
        self._due_ns = {node: heard_ns(node) for node in (1, 2, 3)}

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        raise AssertionError("it hears nothing")

    def start(self, now_ns: int) -> None:
        pass

    def wake(self, now_ns: int) -> None:
        for node in [node for node, due_ns in self._due_ns.items() if due_ns <= now_ns]:
            del self._due_ns[node]
            self.outbox.append((self._names.sensor(node, "wifi"), scan(now_ns)))

    def next_wake_ns(self) -> int | None:
        return min(self._due_ns.values(), default=None)


def heard_ns(node: int) -> int:
    return 3 * S + 50 * MS * node


def scan(now_ns: int) -> WifiScan:
    return WifiScan(now_ns, ((PHONE, -60.0),))


async def with_a_router(network: Network, path: Path) -> list[Record]:
    """The launcher's part: clock and sensors over Zenoh, frames over the interfaces."""
    topic_names = Topics("field")
    batches: list[bytes] = []
    endpoint = f"tcp/{network.bridge}:17447"
    with Bus.serve(endpoint) as bus:
        bus.subscribe(topic_names.all_traces, lambda _, payload: batches.append(payload))
        keeper = ClockKeeper(bus, topic_names, time_scale=1.0, expected=[f"agent-{n}" for n in range(1, COUNT + 1)])
        processes = fly(network, path, "--connect", endpoint)
        try:
            clock = SwarmClock(await keeper.start(timeout_s=30))
            for node in (1, 2, 3):
                await asyncio.sleep(clock.wait_s(heard_ns(node)))
                bus.put(topic_names.sensor(node, "wifi"), codecs.encode([scan(clock.now_ns())]))
            reports = await asyncio.to_thread(finished, processes)
        finally:
            for process in processes:
                process.kill()
                process.communicate()
    assert all(report["radio"]["malformed"] == 0 for report in reports if "malformed" in report["radio"])  # type: ignore[index, operator]
    decoded = [message for payload in batches for message in codecs.decode(payload)]
    return [record for message in decoded if isinstance(message, TraceBatch) for record in message.records]


async def test_the_same_mission_messages_arrive_over_real_sockets_as_in_emulation(
    network: Network, tmp_path: Path
) -> None:
    path = tmp_path / "field.toml"
    path.write_text(SCENARIO)
    records = await with_a_router(network, path)
    pairs = report_pairs(records)
    assert pairs == in_emulation(path) == {(a, b) for a in (1, 2, 3) for b in range(1, 6) if a != b}
    traffic = {(r.node, r.seq) for r in records if isinstance(r, Generated) and r.app == "traffic"}
    delivered = [r for r in records if isinstance(r, Delivered) and (r.origin, r.seq) in traffic]
    assert len(traffic) == COUNT * 3
    assert len(delivered) == len(traffic) * (COUNT - 1)
    assert max(r.delay_ns for r in delivered) < 500 * MS


@pytest.mark.slow
def test_without_a_router_the_swarm_starts_at_the_epoch_that_all_were_given(network: Network, tmp_path: Path) -> None:
    path = tmp_path / "field.toml"
    path.write_text(SCENARIO)
    for ahead_s in (8, 20, 40):
        epoch_s = time.time_ns() / S + ahead_s
        reports = finished(fly(network, path, "--epoch", str(epoch_s)))
        if all(report["generated"] == 3 for report in reports):
            break  # otherwise this machine is so busy that the epoch was past when the processes were up
    assert time.time_ns() / S >= epoch_s + config.load(path).duration_ns / S, "the time of all began there"
    for report in reports:
        assert report["generated"] == 3
        assert report["receptions"] >= 3 * (COUNT - 1)  # type: ignore[operator]
