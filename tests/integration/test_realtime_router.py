"""The router of services that are started one by one: what it says, and what it keeps when interrupted."""

import asyncio
import json
import os
import signal
from pathlib import Path

import pytest
from kit import MakeScenario

from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError
from fanet_mw.hosts import interrupts, loop
from fanet_mw.hosts.bus import Bus
from fanet_mw.hosts.clock import ClockKeeper, ClockListener
from fanet_mw.hosts.presence import expected_names
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.fingerprint import fingerprint
from sim.cli.options import OutputFlags
from sim.cli.runs import finish
from sim.results.outcome import Outcome
from sim.run import router
from sim.run.launcher.swarm import free_endpoint, launch

SWARM = Topics("alone")


async def all_services(scenario: Scenario, endpoint: str) -> None:
    """What all services of a swarm do on the bus, but for what they have to say: they leave with the swarm's time."""
    with await asyncio.to_thread(Bus.join, endpoint, patience_s=30.0) as bus:
        listener = ClockListener(bus, SWARM)
        for name in expected_names(scenario):
            bus.announce(SWARM.alive(name, fingerprint=fingerprint(scenario), instance="1"))
        clock = await listener.running(timeout_s=30)
        while (left_s := clock.wait_s(clock.ends_ns or scenario.duration_ns)) > 0:
            await asyncio.wait([asyncio.ensure_future(listener.changed.wait())], timeout=left_s)
            listener.changed.clear()


def served(
    scenario: Scenario, out: Path | None, *, stop: signal.Signals | None = None
) -> tuple[Outcome | None, list[str]]:
    """What the router has heard, and what it says, without who is missing before the start; it may get a signal."""
    endpoint, said = free_endpoint(), list[str]()

    def on_event(what: str) -> None:
        said.append(what)
        if stop is not None and what.startswith("all are there"):
            asyncio.get_running_loop().call_later(0.7, os.kill, os.getpid(), stop)

    async def run() -> Outcome | None:
        services = asyncio.ensure_future(all_services(scenario, endpoint))
        heard = await router.serve(scenario, swarm=SWARM.swarm, listen=endpoint, on_event=on_event, out=out)
        await services
        return heard

    before = {number: signal.getsignal(number) for number in interrupts.SIGNALS}
    interrupts.install()
    try:
        return loop.run(run()), said[said.index("all are there: the clock runs") + 1 :]
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_services_that_leave_with_the_swarms_time_are_not_missing(
    make_scenario: MakeScenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(router, "WORD_EVERY_S", 0.1)
    assert served(make_scenario(duration_s=0.5, warmup_s=0, drain_s=0), None) == (None, [])


def test_what_was_collected_until_a_signal_is_a_partial_result(
    make_scenario: MakeScenario, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(router, "_LAST_WORDS_S", 0.0)
    heard, said = served(make_scenario(duration_s=60, warmup_s=0, drain_s=0), tmp_path, stop=signal.SIGTERM)
    assert said == ["interrupted by SIGTERM"]
    assert heard is not None
    assert finish(heard, OutputFlags(out=tmp_path)) == 1
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["aborted"] == "interrupted by SIGTERM"
    assert 1 < summary["simulated_s"] < 30
    assert f"written to {tmp_path}" in capsys.readouterr().out


async def test_no_swarm_is_launched_under_the_name_of_another_on_the_same_router(make_scenario: MakeScenario) -> None:
    scenario, endpoint = make_scenario(), free_endpoint()
    with Bus.serve(endpoint) as bus:
        ClockKeeper(bus, SWARM, time_scale=1.0, expected=["agent-1"], scenario=scenario)
        with pytest.raises(BusError, match=rf"swarm alone is already served on {endpoint}: another name \(--swarm\)"):
            await launch(scenario, swarm=SWARM.swarm, connect=endpoint, heed_signals=False)
