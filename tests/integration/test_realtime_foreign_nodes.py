"""Worlds, readers and services that somebody else starts or has written, around one router."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import Bus
from sim.run.launcher.swarm import free_endpoint

ROOT = Path(__file__).parents[2]
SMALL = [
    "--set", "nodes.count=2", "nodes.spacing_m=100", "clusters.count=1", "world.engine=kinematic",
    "mission.survivors=0", "traffic.sources=1", "traffic.interval_s=0.2", "warmup_s=1", "drain_s=1",
    "mobility.model=static", "radio.late_limit=1", "radio.lead_ms=150", "routing.protocol=flooding", "--duration", "4",
]  # fmt: skip


OLDER = """
import sys
from fanet_mw.bus import codecs
codecs.LAYOUT = "older"
from fanet_mw.__main__ import main
sys.exit(main())
"""
"""A program whose bus messages have another layout."""


class Processes:
    """What a test has started; whatever still runs in the end is ended."""

    def __init__(self, stack: ExitStack, folder: Path) -> None:
        self._stack = stack
        self._folder = folder

    def start(self, *command: str) -> "subprocess.Popen[str]":
        process = subprocess.Popen(
            [sys.executable, *command], cwd=self._folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"},
        )  # fmt: skip
        self._stack.enter_context(process)
        self._stack.callback(process.kill)
        return process

    def fanet(self, command: str, *arguments: str) -> "subprocess.Popen[str]":
        return self.start("-m", "fanet_mw", command, "quick", *arguments, *SMALL)


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    with ExitStack() as stack:
        yield Processes(stack, tmp_path)


def test_a_world_and_a_reader_that_know_zenoh_alone(processes: Processes, tmp_path: Path) -> None:
    endpoint = free_endpoint()
    launch = processes.fanet(
        "launch", "--no-world", "--listen", endpoint, "--swarm", "foreign", "--out", "out", "--json"
    )
    with _router(endpoint):
        pass
    examples = ROOT / "examples" / "bus"
    world = processes.start(str(examples / "world.py"), endpoint, "foreign")
    reader = processes.start(str(examples / "reader.py"), endpoint, "foreign", "60")
    out, err = launch.communicate(timeout=100)
    summary = json.loads(out)
    assert summary["pdr"] > 0.5, err
    assert summary["absent"] == {}, "no report is asked of a world of somebody else"
    reader.send_signal(signal.SIGINT)
    heard = json.loads(reader.communicate(timeout=60)[0])
    assert heard["2"]["frames"] > 5
    assert heard["2"]["bytes"] > 256 * 5
    assert world.wait(timeout=60) == 0, world.communicate()[1]


def _router(endpoint: str) -> Bus:
    """A session, as soon as there is a router."""
    return Bus.join(endpoint, patience_s=60)


@pytest.mark.slow
def test_a_router_names_who_is_wrong_and_writes_what_the_right_ones_did(processes: Processes, tmp_path: Path) -> None:
    endpoint = free_endpoint()
    join = ("--connect", endpoint)
    router = processes.fanet("router", "--listen", endpoint, "--out", "out")
    assert router.stderr is not None
    with _router(endpoint) as bus:
        stranger = processes.fanet("agent", "--id", "1", *join, "--set", "traffic.payload_bytes=300")
        _, said = stranger.communicate(timeout=60)
        assert stranger.returncode == 2
        assert "agent-1 runs another scenario than swarm quick: traffic.payload_bytes = 300 here, 256 there" in said

        older = processes.start("-c", OLDER, "agent", "quick", "--id", "1", *join, *SMALL)
        _, said = older.communicate(timeout=60)
        assert older.returncode == 2
        assert "swarm quick lays bus messages out as" in said

        services = [processes.fanet("emulator", *join), processes.fanet("agent", "--id", "1", *join)]
        bus.announce(Topics("quick").alive("agent-1"))
        lines = _until(router, "there twice: agent-1")
        assert any("missing: " in line and "agent-2" in line and "world" in line for line in lines)
    services += [processes.fanet("agent", "--id", "2", *join), processes.fanet("world", *join)]
    _until(router, "all are there: the clock runs")
    out, err = router.communicate(timeout=60)
    assert router.returncode in (0, 1), err  # 1: this machine did not hold real time
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["pdr"] > 0.5
    assert summary["absent"] == {}
    assert "traffic" in out
    assert [service.wait(timeout=60) for service in services] == [0, 0, 0, 0]


def _until(router: "subprocess.Popen[str]", wanted: str) -> list[str]:
    """Lines of the router up to the one that has these words."""
    assert router.stderr is not None
    lines, end_s = [], time.monotonic() + 60
    while time.monotonic() < end_s:
        lines.append(router.stderr.readline())
        if wanted in lines[-1]:
            return lines
    raise AssertionError(lines)
