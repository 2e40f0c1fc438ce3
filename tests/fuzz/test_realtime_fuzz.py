"""A swarm of real processes, one of which is the fuzzer of the air: the others live on, and all is accounted for."""

import asyncio
from typing import Any

import pytest
from air import EVIL, Fuzzer

from agents.__main__ import run as run_agent
from fanet_mw.hosts import service
from fanet_mw.hosts.realtime import SwarmAddress
from fanet_mw.scenario import Scenario
from sim.results.files import finish
from sim.run.launcher.swarm import launch
from sim.scenarios import catalog


def agent_or_fuzzer(*, scenario: Scenario, address: SwarmAddress, node: int, **others: Any) -> int:
    """What runs in the place of an agent."""
    if node != EVIL:
        return run_agent(scenario, address, node=node, **others)
    fuzzer = Fuzzer(address.swarm, scenario.seed, every_ms=10, lead_ms=60)
    service.live(fuzzer, scenario, address)
    return 0


@pytest.mark.slow
def test_near_misses_off_a_real_time_air_end_no_process_and_close_the_books(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim.run.launcher.services.run_agent", agent_or_fuzzer)
    times = ["duration_s=5", "warmup_s=1", "drain_s=1"]
    settings = [
        "radio.lead_ms=150",
        "clusters.relay=counter",
        "clusters.flooding_period_s=0.5",
        "clusters.repair_s=5",
        "clock.sync=beacons",
    ]
    scenario = catalog.find("quick", [*times, *settings])
    outcome = asyncio.run(launch(scenario, swarm="test"))
    summary = finish(outcome, out=None)
    assert (outcome.ended, outcome.aborted) == ([], None)
    honest = [outcome.reports[f"agent-{node}"] for node in scenario.node_ids if node != EVIL]
    assert all(report["final"] for report in honest)
    refused = sum(report["dropped"].get(why, 0) for report in honest for why in ("malformed", "forged"))
    assert refused > 100, "they were attacked"
    assert summary["frames"]["closes"]
    assert summary["heard"]["malformed"] == 0
    assert summary["delivered"] > 0
