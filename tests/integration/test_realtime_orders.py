"""`fanet order` while a swarm of processes flies: what the post gives is obeyed, and the command says so."""

import asyncio

import pytest

from fanet_mw.scenario import config
from fanet_mw.trace import MissionModeChanged, Ordered
from fanet_mw.units import S
from sim.cli.app import app
from sim.run.launcher.swarm import SwarmRun, launch

SCENARIO = {
    "nodes": {"count": 4, "layout": "grid", "spacing_m": 60.0, "altitude_m": 40.0, "telemetry_hz": 0},
    "duration_s": 16.0, "warmup_s": 1.0, "drain_s": 1.0, "clusters": {"count": 1, "flooding_period_s": 1.0},
    "mission": {"survivors": 1, "search": "spiral"}, "mobility": {"model": "onboard", "speed_m_s": 7.5},
    "world": {"area_m": 300.0}, "radio": {"range_m": 250.0, "lead_ms": 150.0}, "traffic": {"arrivals": "none"},
    "ground": {"at_m": (0.0, -180.0)},
}  # fmt: skip
POST = 5


@pytest.mark.timeout(120)
def test_an_order_by_command_reaches_the_uav_that_it_is_for(capsys: pytest.CaptureFixture[str]) -> None:
    said: list[str] = []
    codes: list[int] = []

    def started(swarm: SwarmRun) -> None:
        async def later() -> None:
            while swarm._clock is None or swarm._clock.now_ns() < 4 * S:  # noqa: ASYNC110  (real time passes)
                await asyncio.sleep(0.05)
            for tokens in (("recall", "3"), ("stay", "20", "-30", "--node", "2")):
                code = await asyncio.to_thread(
                    app, ["order", *tokens, "--swarm", "orders"], result_action="return_value"
                )
                codes.append(code)

        swarm.task = asyncio.ensure_future(later())  # type: ignore[attr-defined]  # kept from the collector

    outcome = asyncio.run(launch(config.build(SCENARIO), swarm="orders", on_event=said.append, on_started=started))
    printed = capsys.readouterr().out
    assert codes == [0, 0]
    assert "order 1: recall, node 3, given at" in printed
    ordered = [r for r in outcome.records if isinstance(r, Ordered)]
    assert {(r.node, r.order) for r in ordered if r.node in (3, POST)} >= {(3, "recall"), (POST, "stay")}
    modes = {(r.node, r.mode) for r in outcome.records if isinstance(r, MissionModeChanged)}
    assert {(3, "recall"), (2, "errand")} <= modes
