"""A swarm too large for real time runs on a slow swarm clock: everything scales with it, and nothing else changes."""

import asyncio
import json
import struct
import time
from itertools import pairwise
from pathlib import Path

import pytest
from kit import slow
from test_air_control import emulator

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import Report, TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import Bus
from fanet_mw.trace import Generated
from fanet_mw.units import BROADCAST, MS, S
from sim.results.files import finish
from sim.run.launcher.swarm import launch
from sim.run.virtual import simulate
from sim.scenarios import catalog


@pytest.mark.parametrize(("time_scale", "late"), [(1.0, True), (0.25, False)])
async def test_a_lead_is_swarm_time_so_that_a_slow_clock_gives_slow_processes_more_of_it(
    time_scale: float, *, late: bool
) -> None:
    """Requests announced 1 s ahead reach the medium 2 s of wall time later: with the slow clock 2 s of it are left."""
    reports: list[bytes] = []
    names = Topics("scaled")
    async with emulator("scaled", reports, time_scale=time_scale) as (endpoint, clock):
        with Bus.join(endpoint) as bus:
            start_ns = clock.now_ns() + S
            await asyncio.sleep(2)
            for seq in range(10):
                request = TxRequest(seq, start_ns, b"frame", BROADCAST, wants_status=False)
                bus.put(names.radio_tx(1), codecs.encode([request]))
            await asyncio.sleep(0.5)
            lag_ms = (clock.now_ns() - start_ns) / MS
    (last,) = codecs.decode(reports[-1])
    assert isinstance(last, Report)
    found = json.loads(last.json)["late"]
    assert found["frames"] == 10
    if late:
        assert found["late_frames"] == 10
        assert 990 < found["max_ms"] < lag_ms
    else:
        assert found["late_frames"] == 0


@pytest.mark.parametrize("time_scale", [0.25, 2.0])
async def test_a_standstill_is_as_long_as_the_swarm_time_that_it_costs(time_scale: float) -> None:
    reports: list[bytes] = []
    async with emulator("frozen", reports, time_scale=time_scale):
        await asyncio.sleep(0.1)
        time.sleep(1.2)  # noqa: ASYNC251 - the emulator lives in this process, and stands still as well
        await asyncio.sleep(0.1)
    (last,) = codecs.decode(reports[-1])
    assert isinstance(last, Report)
    stall_ms = json.loads(last.json)["host"]["stall_ms"]
    assert 600 * time_scale < stall_ms < 1200 * time_scale + 500


@pytest.mark.parametrize("time_scale", [pytest.param(0.5, marks=pytest.mark.slow), 2.0])
async def test_a_swarm_of_processes_lives_by_its_clock(tmp_path: Path, time_scale: float) -> None:
    changes = [
        "nodes.count=4",
        "routing.protocol=flooding",
        "mission.survivors=0",
        "world.engine=kinematic",
        "duration_s=3",
    ]
    changes += ["warmup_s=1", "drain_s=0.5", "traffic.interval_s=0.25", "radio.lead_ms=400"]
    changes.append(f"time_scale={time_scale}")
    scenario = catalog.find("quick", changes)
    pcap = tmp_path / "air.pcap"
    began_ns = time.time_ns()
    outcome = await launch(scenario, swarm="scaled", emulator_options={"pcap": pcap, "receptions": False})
    summary, virtual = finish(outcome, out=tmp_path), finish(simulate(scenario), out=None)
    assert summary["time_scale"] == time_scale
    assert 3 / time_scale <= summary["wall_s"] < 3 / time_scale + 2 + outcome.stall_ms / 1000
    assert summary["frames"]["closes"]
    assert summary["aborted"] is None
    assert summary["generated"] == virtual["generated"], "as much happens in a swarm second as ever"
    assert summary["pdr"] > 0.9
    generated = [record.t_ns for record in outcome.records if isinstance(record, Generated)]
    assert 1 * S <= min(generated) < max(generated) < 2.5 * S
    host = outcome.reports["agent-1"]["host"]
    assert host["overflowed"] == host["malformed"] == 0
    seconds, _ = struct.unpack_from("<II", pcap.read_bytes(), 24)
    assert began_ns // S <= seconds <= began_ns // S + 60, "stamped with the epoch"


@pytest.mark.parametrize("slow_down_to", [*slow(None), 5.0])
async def test_a_machine_that_cannot_keep_up_slows_the_clock_if_it_may(slow_down_to: float | None) -> None:
    """At 80 times real time no machine wakes ten processes in time."""
    said: list[str] = []
    changes = ["time_scale=80", "duration_s=320", "drain_s=10", "traffic.interval_s=0.2"]
    scenario = catalog.find("quick", [*changes, "world.engine=kinematic", "mission.survivors=0"])
    outcome = await launch(scenario, swarm="hurried", slow_down_to=slow_down_to, on_event=said.append)
    summary = finish(outcome, out=None)
    scales = [step["time_scale"] for step in summary["slowed"]]
    falls = [later < earlier for earlier, later in pairwise([80.0, *scales])]
    assert sum("slows to" in text for text in said) == sum(falls)
    if slow_down_to is None:
        assert scales == []
        assert summary["wall_s"] < 320 / 80 + 2 + outcome.stall_ms / 1000
    else:
        assert 5.0 <= min(scales) < 80
        assert sum(pace["wall_s"] for pace in summary["paces"]) == pytest.approx(summary["wall_s"], rel=0.2)
        assert summary["wall_s"] > 320 / 80 + 0.5
    assert summary["frames"]["unaccounted"] == 0
    assert not summary["processes"]["ended"]
