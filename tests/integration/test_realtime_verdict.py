"""Real swarms whose parts die, freeze or are restarted: none of them may be called valid that is not."""

import asyncio
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from undisturbed import LIMIT_S, with_time_enough

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import Poses
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import Bus
from fanet_mw.scenario import Scenario
from fanet_mw.units import S
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.launcher.swarm import SwarmRun, launch
from sim.scenarios import catalog

SHORT = ["duration_s=4", "warmup_s=1", "drain_s=0.5", "clusters.flooding_period_s=0.5", "world.engine=kinematic",
         "radio.lead_ms=150", "nodes.count=5", "clusters.count=1"]  # fmt: skip
NINE = ("nodes.count=9", "clusters.count=2")
Act = Callable[[SwarmRun], None]


def scenario(*overrides: str) -> Scenario:
    return catalog.find("quick", [*SHORT, *overrides])


def run(
    chosen: Scenario, *acts: tuple[float, Act], respawn: bool = False, tell: Callable[[str], None] = print
) -> tuple[Outcome, dict[str, Any]]:
    """Launch, do each act at its swarm instant [s], and summarize."""
    tasks = []

    def started(swarm: SwarmRun) -> None:
        async def later(at_s: float, act: Act) -> None:
            while swarm._clock is None or swarm._clock.now_ns() < at_s * S:  # noqa: ASYNC110  (real time passes)
                await asyncio.sleep(0.02)
            act(swarm)

        tasks.extend(asyncio.ensure_future(later(*item)) for item in acts)

    outcome = asyncio.run(launch(chosen, swarm="verdict", respawn=respawn, on_event=tell, on_started=started))
    return outcome, finish(outcome, out=None)


def send(number: signal.Signals, *names: str) -> Act:
    def act(swarm: SwarmRun) -> None:
        for name in names:
            os.kill(swarm.processes.pid(name), number)

    return act


def about(summary: dict[str, Any], what: str) -> str:
    """The reason that begins so; what else a busy machine adds is its own affair."""
    assert not summary["valid"]
    found = [why for why in summary["invalid_because"] if why.startswith(what)]
    assert len(found) == 1, summary["invalid_because"]
    return found[0]


def test_a_run_whose_agents_were_all_killed_is_not_valid() -> None:
    agents = [f"agent-{node}" for node in range(1, 6)]
    _, summary = run(scenario(), (1.5, send(signal.SIGKILL, *agents)))
    assert about(summary, "agent-").endswith("ended before the end, with signal SIGKILL: 5, limit 0")
    assert summary["frames"]["closes"], "what they had asked for is accounted for all the same"


@pytest.mark.timeout(LIMIT_S)
@pytest.mark.slow
def test_a_run_whose_emulator_was_killed_and_started_again_is_not_valid_and_says_what_is_missing() -> None:
    outcome, summary = with_time_enough(
        lambda slower: run(
            scenario("duration_s=6", *NINE, slower), (1.5, send(signal.SIGKILL, "emulator")), respawn=True
        ),
        lambda found: found[0].reports["emulator"]["frames"]["delivered"] > 20 > found[1]["frames"]["in_flight"],
    )
    assert about(summary, "emulator ended")
    missing = summary["frames"]["unaccounted"]
    assert missing > 20
    assert about(summary, "frames unaccounted") == (
        f"frames unaccounted for: {missing} of {summary['frames']['sent']}, limit 0"
    )
    assert not summary["frames"]["closes"]
    assert outcome.aborted is None
    assert outcome.reports["emulator"]["frames"]["delivered"] > 20, "frames flow again"
    assert summary["frames"]["in_flight"] < 20, "what nobody knows of is not called in flight"


@pytest.mark.slow
def test_a_run_whose_world_stood_still_for_seconds_is_not_valid_and_the_world_is_named_meanwhile() -> None:
    said: list[str] = []
    moving = scenario("duration_s=7.5", "mobility.model=formation")
    frozen = (1.0, send(signal.SIGSTOP, "world")), (6.0, send(signal.SIGCONT, "world"))
    outcome, summary = run(moving, *frozen, tell=said.append)
    assert outcome.ended == []
    assert [what[-24:] for what in said if "no report" in what] == ["no report for 4 s: world"]
    why = about(summary, "longest standstill")
    assert "(world), limit 500 ms" in why
    assert 4500 < summary["disturbance"]["stall_ms"]["value"] < 9000
    assert about(summary, "ticks that the world skipped")


@pytest.mark.slow
def test_a_process_that_is_frozen_to_the_end_has_no_last_report() -> None:
    _, summary = run(scenario(), (2.0, send(signal.SIGSTOP, "agent-4")))
    assert about(summary, "no last report") == "no last report of agent-4: 1, limit 0"


class Watch:
    """The positions that the world tells, as anybody on the bus sees them."""

    def __init__(self) -> None:
        self.poses: list[Poses] = []

    def __call__(self, swarm: SwarmRun) -> None:
        self.bus = Bus.join(swarm.address.endpoint)
        self.bus.subscribe(Topics("verdict").pose, lambda _, payload: self.poses.extend(codecs.decode(payload)))  # type: ignore[arg-type]

    def jump_m(self) -> float:
        """The farthest that a UAV was from where it had been in the poses before."""
        places = [np.array(poses.states).reshape(-1, 6)[:, :3] for poses in self.poses]
        return float(max(np.linalg.norm(b - a, axis=1).max() for a, b in pairwise(places)))


@pytest.mark.slow
def test_a_world_that_is_started_again_goes_on_where_it_was_and_the_run_is_not_valid() -> None:
    watch = Watch()
    fast = scenario("duration_s=6", "mobility.model=formation", "mobility.speed_m_s=15")
    _, summary = run(fast, (0.5, watch), (2.5, send(signal.SIGKILL, "world")), respawn=True)
    watch.bus.close()
    assert about(summary, "world ended") == "world ended before the end, with signal SIGKILL: 1, limit 0"
    assert watch.poses[-1].t_ns > 5 * S, "there are poses again"
    far_m = np.linalg.norm(np.array(watch.poses[-1].states)[:3] - np.array(watch.poses[0].states)[:3])
    assert far_m > 40, "far from where they started"
    assert watch.jump_m() < 10


@pytest.mark.slow
def test_a_launcher_that_is_stopped_until_after_the_end_does_not_exit_with_0() -> None:
    """It is the router too: nothing reaches anybody meanwhile."""
    command = [sys.executable, "-m", "sim.cli.app", "launch", "quick", "--json"]
    for key in SHORT:
        command += ["--set", key]
    launcher = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert launcher.stderr is not None
    for line in launcher.stderr:
        if b"processes up" in line:
            break
    time.sleep(1.5)
    launcher.send_signal(signal.SIGSTOP)
    time.sleep(4)
    launcher.send_signal(signal.SIGCONT)
    out, _ = launcher.communicate(timeout=90)
    assert launcher.returncode == 1
    assert "(the launcher), limit 500 ms" in about(json.loads(out), "longest standstill")


@pytest.mark.parametrize("step_s", [-10.0, 10.0])
@pytest.mark.slow
def test_an_agent_that_is_started_again_after_a_step_of_the_clock_takes_part(
    step_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its process reads a unix clock that is off by the step; the swarm's time is handed to it."""
    monkeypatch.setattr("sim.run.launcher.services.run_agent", partial(agent_after_a_step, step_s))
    outcome, summary = run(scenario("duration_s=5"), (1.5, send(signal.SIGKILL, "agent-4")), respawn=True)
    assert [name for name, _ in outcome.ended] == ["agent-4"], "once, because it was killed"
    assert about(summary, "agent-4 ended")
    assert outcome.reports["agent-4"]["final"]
    again = outcome.reports["agent-4"]["host"]
    assert again["asked_past_ms"] < 200 + again["stall_ms"]
    frames = summary["frames"]
    assert frames["closes"]
    assert frames["dropped"].get("late", 0) < 20, "it does not send for instants that are long past"


def agent_after_a_step(step_s: float, **arguments: Any) -> int:
    """An agent on a machine whose unix clock has been stepped."""
    from agents.__main__ import run
    from fanet_mw.hosts import service
    from fanet_mw.hosts.timebase import THIS_MACHINE

    stepped = THIS_MACHINE._replace(unix_ns=lambda: time.time_ns() + round(step_s * S))
    run_actor = service.run_actor
    service.run_actor = lambda *given, **named: run_actor(*given, **named, timebase=stepped)  # type: ignore[attr-defined]
    return run(**arguments)
