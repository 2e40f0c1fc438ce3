"""A client of the router that puts what it should not, while a swarm of real processes runs."""

import asyncio
import threading
import time
from pathlib import Path
from typing import Self

import air_attacks
import pytest
from realtime_attacks import attacked_in_real_time
from undisturbed import LIMIT_S, undisturbed

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import ClockEpoch, ClockState, MavlinkTap, Message, Report, TraceBatch
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import MAX_PUT_BYTES, Bus
from fanet_mw.trace import Approaching, Delivered, Generated
from fanet_mw.units import S
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.launcher.swarm import SwarmRun, free_endpoint, launch
from sim.scenarios import catalog

NAMES = Topics("test")
SMALL = [
    "nodes.count=4", "clusters.count=1", "duration_s=7", "warmup_s=4", "drain_s=1", "clusters.flooding_period_s=0.5",
    "radio.lead_ms=150",
]  # fmt: skip
"""The lead is long, because here it is not asked whether a machine that runs other tests besides is on time. Traffic
begins once a schedule has had several hellos in which to reach everyone."""


FORGED_CLOCKS: list[tuple[str, list[Message]]] = [
    (NAMES.clock, [ClockEpoch(0, 1.0, ClockState.STOPPED), ClockEpoch(5, 50.0, ClockState.RUNNING)]),
]
NONSENSE: list[tuple[str, list[Message]]] = [
    (NAMES.report("agent-3"), [Report("agent-3", S, '{"kind": "agent", "node": 3}')]),
    (NAMES.report("emulator"), [Report("emulator", S, '{"kind": "emulator", "frames": {"sent": "many"}}')]),
    (NAMES.trace("agent-4"), [TraceBatch((Generated(S, 77, 1, "traffic", 5), Delivered(S, 4, 99, 1, 3, 1)))]),
    (NAMES.trace("agent-4"), [TraceBatch((Approaching(S, 4, 99, 3, 1.0, 1.0),))]),
    (NAMES.trace("agent-77"), [TraceBatch((Generated(S, 77, 1, "traffic", 5),))]),
    (NAMES.mavlink(3), [MavlinkTap(2**63 - 1, b""), MavlinkTap(S, b"no frame")]),
]


class Attacker:
    """Puts the same again and again, from the moment the router is there until the swarm is over."""

    def __init__(self, endpoint: str, puts: list[tuple[str, list[Message]]], *, every_s: float = 0.3) -> None:
        self._endpoint = endpoint
        self._puts = [(topic, codecs.encode(messages)) for topic, messages in puts]
        self._every_s = every_s
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        with Bus.join(self._endpoint) as bus:
            while not self._over.wait(self._every_s):
                for topic, payload in self._puts:
                    bus.put(topic, payload, reliable=True)

    def __enter__(self) -> Self:
        return self

    def start(self, _: SwarmRun) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()


def attacked(puts: list[tuple[str, list[Message]]], *settings: str) -> Outcome:
    """A run under attack."""
    endpoint = free_endpoint()
    with Attacker(endpoint, puts) as attacker:
        scenario = catalog.find("quick", [*SMALL, *settings])
        return asyncio.run(launch(scenario, swarm="test", listen=endpoint, on_started=attacker.start))


@pytest.mark.slow
def test_a_forged_clock_that_is_stopped_stops_nobody() -> None:
    """Without an access list anyone may put on the clock's topic, but only its keeper's answer counts."""
    outcome = attacked(FORGED_CLOCKS)
    assert {report["final"] for report in outcome.reports.values()} == {True}
    assert max(record.t_ns for record in outcome.records if isinstance(record, Delivered)) > 5.5 * S
    assert outcome.aborted is None


@pytest.mark.timeout(LIMIT_S)
def test_nonsense_for_the_launcher_is_counted_and_the_result_is_that_of_the_swarm(tmp_path: Path) -> None:
    outcome, _ = undisturbed(lambda slower: attacked(NONSENSE, slower))
    summary = finish(outcome, out=tmp_path)
    assert set(summary["heard"]["why"]) == {
        "report: shape", "trace: node", "trace: survivor", "trace: unknown actor", "telemetry: instant",
        "telemetry: frame",
    }  # fmt: skip
    assert summary["absent"] == {}
    assert summary["unwritten"] == {}
    assert summary["frames"]["closes"]
    assert summary["frames"]["sent"] > 10
    assert summary["pdr"] > 0.5
    assert {record.node for record in outcome.records} <= {0, 1, 2, 3, 4}


@pytest.mark.slow
def test_attacks_over_the_air_end_no_process_and_are_refused_and_the_books_close() -> None:
    """Four at once; each alone, in both modes, is a row of docs/results/attacks.md."""
    names = [
        "survivor reports of 1e10 dBm, as everybody", "digests of sequences far ahead",
        "sequence numbers of the far future", "joins of heads 255 hops away",
    ]  # fmt: skip
    shorter = air_attacks.scenario(
        "duration_s=13", "warmup_s=7", "drain_s=1", "radio.lead_ms=150", "clusters.repair_s=20"
    )
    outcome = attacked_in_real_time(shorter, *names)
    assert (outcome.ended, outcome.aborted) == ([], None)
    honest = [outcome.reports[f"agent-{node}"] for node in air_attacks.HONEST]
    assert all(report["final"] for report in honest)
    for reason in ("malformed", "forged"):
        assert sum(report["dropped"].get(reason, 0) for report in honest) > 50, reason
    summary = finish(outcome, out=None)
    assert summary["frames"]["closes"]
    assert summary["pdr"] > 0


def test_a_put_longer_than_anyone_means_ends_where_it_arrives() -> None:
    """Neither the router nor a client gathers it in memory, and the session of whoever put it goes on."""
    endpoint = free_endpoint()
    heard: list[tuple[str, int]] = []
    with Bus.serve(endpoint) as router, Bus.join(endpoint, patience_s=30) as sender, Bus.join(endpoint) as other:
        router.subscribe("x", lambda _, payload: heard.append(("router", len(payload))))
        other.subscribe("x", lambda _, payload: heard.append(("client", len(payload))))
        time.sleep(0.5)
        for size in (1_000, 5_000_000, MAX_PUT_BYTES + 1, 40_000_000, 2_000):
            sender.put("x", bytes(size), reliable=True)
        for _ in range(1200):
            if len(heard) >= 6:
                break
            time.sleep(0.05)
    assert sorted(heard) == [(who, size) for who in ("client", "router") for size in (1_000, 2_000, 5_000_000)]
