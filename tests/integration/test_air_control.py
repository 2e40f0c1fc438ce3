"""`fanet air` against an emulator that runs in real time: a real router, real sessions, the real command."""

import asyncio
import contextlib
import json
import re
import time
from array import array
from collections.abc import AsyncIterator

import pytest

from emulator.compile_kernel import warm_up
from emulator.medium import Medium
from fanet_mw.bus import codecs
from fanet_mw.bus.messages import Poses, Report, TxRequest
from fanet_mw.bus.radio_control import Control, Cut, Restore
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import FanetError
from fanet_mw.hosts.bus import Bus
from fanet_mw.hosts.clock import ClockKeeper, SwarmClock
from fanet_mw.hosts.realtime import SwarmAddress, run_actor
from fanet_mw.units import BROADCAST, MS, NodeId, S
from sim.bus import operator_commands
from sim.cli.app import app
from sim.results.files import finish
from sim.run.launcher.swarm import free_endpoint
from sim.run.virtual import simulate
from sim.scenarios import catalog


@contextlib.asynccontextmanager
async def emulator(
    swarm: str, reports: list[bytes], *, time_scale: float = 1.0
) -> AsyncIterator[tuple[str, SwarmClock]]:
    """An emulator of nine nodes; yields the endpoint of its router and the clock; stops it at the end."""
    endpoint = free_endpoint()
    scenario = catalog.find("quick")
    warm_up()
    with Bus.serve(endpoint) as bus:
        bus.subscribe(Topics(swarm).report("emulator"), lambda _, payload: reports.append(payload))
        keeper = ClockKeeper(bus, Topics(swarm), time_scale=time_scale, expected=["emulator"])
        host = asyncio.create_task(run_actor(Medium(scenario, swarm), SwarmAddress(swarm, endpoint), until_ns=1000 * S))
        clock = SwarmClock(await keeper.start(timeout_s=60))
        await asyncio.sleep(clock.wait_s(10 * MS))
        try:
            yield endpoint, clock
        finally:
            keeper.stop()
            await host
            for _ in range(600):  # the last report is on its way
                if reports and b'"final": true' in reports[-1]:
                    break
                await asyncio.sleep(0.1)


async def command(*tokens: str) -> int:
    code: int = await asyncio.to_thread(app, list(tokens), result_action="return_value")
    return code


async def test_a_node_is_cut_off_and_restored_by_command(capsys: pytest.CaptureFixture[str]) -> None:
    reports: list[bytes] = []
    async with emulator("air-test", reports) as (endpoint, _):
        assert await command("air", "cut", "3", "--connect", endpoint) == 0
        assert await command("air", "degrade", "1", "2", "--loss-share", "0.5", "--connect", endpoint) == 0
        assert await command("air", "jam", "0", "0", "100", "--for", "0.2", "--connect", endpoint) == 0
        assert await command("air", "restore", "node-3", "--connect", endpoint, "--swarm", "air-test") == 0
    said = [line.rsplit(" ", 2)[0] for line in capsys.readouterr().out.splitlines()]
    assert said[:2] == ["node-3: cut since", "link-1-2: degrade since"]
    assert said[2] == "jam: jam since"
    assert said[-1] == "node-3: cut ended at"
    (last,) = codecs.decode(reports[-1])
    assert isinstance(last, Report)
    assert json.loads(last.json)["controls"] == 4


@pytest.mark.parametrize(
    ("control", "why", "refused"),
    [
        (Cut("x", NodeId(99)), "refused", 1),
        (Restore("nothing"), "no fault that can end has the label 'nothing'", 1),
        (Restore(""), "no fault that can end is in force", 0),
    ],
)
async def test_what_the_emulator_refuses_is_said_and_counted(
    control: Control, why: str, refused: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(operator_commands, "CONFIRM_TIMEOUT_S", 1.2)
    reports: list[bytes] = []
    async with emulator("air-test", reports) as (endpoint, _):
        with pytest.raises(FanetError, match=rf"did not confirm within 1\.2 s: {why}"):
            await asyncio.to_thread(operator_commands.change, endpoint, None, control)
    (last,) = codecs.decode(reports[-1])
    assert isinstance(last, Report)
    assert sum(json.loads(last.json)["refused"].values()) == refused


async def test_without_a_swarm_or_with_two_the_command_asks_for_the_name() -> None:
    endpoint = free_endpoint()
    with Bus.serve(endpoint) as bus:
        with pytest.raises(FanetError, match="no emulator of a swarm runs on this router"):
            await asyncio.to_thread(operator_commands.change, endpoint, None, Restore(""))
        for swarm in ("one", "two"):
            bus.announce(Topics(swarm).alive("emulator"))
        with pytest.raises(FanetError, match=r"2 swarms with an emulator on this router \(one, two\): say --swarm"):
            await asyncio.to_thread(operator_commands.change, endpoint, None, Restore(""))


@pytest.mark.slow
def test_a_scenarios_faults_are_the_same_in_every_run_of_a_seed() -> None:
    """In virtual time: what they do reaches the application, every frame is accounted for, the trace repeats."""
    changes = ["duration_s=10", "warmup_s=4", "drain_s=1", "mission.survivors=0"]
    faults = (
        'faults=[{at_s=4.5, kind="cut", node=9, for_s=4.0}, {at_s=5, kind="jam", center_m=[0, 0], radius_m=100},'
        ' {at_s=5, kind="degrade", src=1, dst=2, loss_share=0.5}, {at_s=8, kind="restore"}]'
    )
    calm = finish(simulate(catalog.find("quick", changes)), out=None)
    first, again = (finish(simulate(catalog.find("quick", [*changes, faults])), out=None) for _ in range(2))
    assert first["trace_sha256"] == again["trace_sha256"] != calm["trace_sha256"]
    assert first["frames"]["closes"]
    assert {"station_down", "jammed", "degraded"} <= set(first["copies"]["lost"])
    assert first["worst_nodes"][0]["pdr"] < calm["worst_nodes"][0]["pdr"] - 0.2


async def test_links_are_shown_as_they_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    """Node 1 is heard by node 2, not by node 3; garbage on the topic is passed over."""
    names = Topics("air-test")
    states = array("d", [v for east in (0, 100, 1000) for v in (east, 0.0, 50.0, 0.0, 0.0, 0.0)])
    async with emulator("air-test", []) as (endpoint, clock):
        with Bus.join(endpoint) as bus:
            shown = asyncio.create_task(command("links", "--connect", endpoint, "--reports", "2", "--node", "2"))
            seq = 0
            while not shown.done():
                poses = Poses(0, array("H", [1, 2, 3]), states)
                request = TxRequest(seq, clock.now_ns() + 10 * MS, bytes(100), BROADCAST, wants_status=False)
                bus.put(names.pose, codecs.encode([poses]))
                bus.put(names.radio_tx(1), codecs.encode([request]))
                bus.put(names.radio_links, b"garbage")
                seq += 1
                await asyncio.sleep(0.05)
            assert await shown == 0
    out = capsys.readouterr().out
    assert re.search(r"air-test at \d+ s: 1 links in 1 s", out)
    assert re.search(r"\b1 +2 +\d+ +100% +-", out), "the channel knows no powers"


async def test_a_node_that_the_swarm_does_not_have_is_named_at_once() -> None:
    async with emulator("air-test", []) as (endpoint, _):
        with Bus.join(endpoint) as keeper:
            keeper.answer(Topics("air-test").scenario, lambda: b'{"nodes": {"count": 9}}')
            began = time.monotonic()
            with pytest.raises(FanetError, match="node 99: the nodes of swarm air-test are 1 to 9"):
                await asyncio.to_thread(operator_commands.change, endpoint, "air-test", Cut("x", NodeId(99)))
            assert time.monotonic() - began < operator_commands.CONFIRM_TIMEOUT_S
