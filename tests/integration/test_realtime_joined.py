"""One application in virtual time, over Zenoh and over UDP between network namespaces: the same messages arrive.

And a program of a user's own that joins a swarm of processes: what it is told, and how it ends.
"""

import asyncio
import json
import subprocess
import sys
import time
from pathlib import Path

import pytest
from correspondent import Correspondent
from installed import EXAMPLES, Installed
from test_real_radio import COUNT, Network, network

import fanet_mw
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import Bus
from fanet_mw.hosts.clock import ClockKeeper
from fanet_mw.scenario import config
from fanet_mw.testing.plugin import LaunchSwarm
from sim.run.launcher.swarm import free_endpoint

__all__ = ["network"]
SCENARIO = """
name = "letters"
duration_s = 12
warmup_s = 1
[nodes]
count = 5
layout = "disc"
radius_m = 50
telemetry_hz = 0
[traffic]
arrivals = "none"
[routing]
protocol = "flooding"
[clusters]
count = 1
[world]
engine = "kinematic"
"""
ONE = ("traffic.sources=1", "warmup_s=0.5", "drain_s=0.5")
Got = set[tuple[int, int, str]]


def _text(path: Path) -> Path:
    path.write_text(SCENARIO, encoding="utf-8")
    return path


def in_virtual_time(path: Path) -> Got:
    result = fanet_mw.simulate(path, applications=lambda node: [Correspondent(node, COUNT)])
    reports = [result.reports[f"agent-{node}"]["applications"]["letters"] for node in range(1, COUNT + 1)]
    assert {fate for report in reports for fate in report["fates"]} == {"acknowledged"}
    got = [tuple(item) for report in reports for item in report["got"]]
    assert len(got) == len(set(got)) == 3 * COUNT * (COUNT - 1) * 2, "each to each, and all to all"
    return set(got)


async def over_zenoh(path: Path) -> Got:
    scenario = config.load(path)
    mails = [Correspondent(node, COUNT) for node in scenario.node_ids]

    async def carry(radio: fanet_mw.Emulated, mail: Correspondent) -> None:
        async with fanet_mw.join(scenario, node=mail.node, radio=radio, applications=[mail]) as node:
            async for _ in node:
                pass

    async with fanet_mw.launch(scenario, leave_out=scenario.node_ids) as swarm:
        await asyncio.gather(*(carry(swarm.radio, mail) for mail in mails))
    assert swarm.result is not None
    assert swarm.result.summary["aborted"] is None
    return {item for mail in mails for item in mail.got}


def on_air(path: Path, network: Network) -> Got:
    epoch = str(time.time() + 10)  # noqa: TID251  (a real clock)
    script = str(Path(__file__).with_name("correspondent.py"))
    processes = [
        subprocess.Popen(
            ["ip", "netns", "exec", name, sys.executable, script, str(path), str(node), network.address(node),
             network.broadcast, epoch],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )
        for node, name in enumerate(network.names, start=1)
    ]  # fmt: skip
    ended = [process.communicate(timeout=60) for process in processes]
    assert [process.returncode for process in processes] == [0] * COUNT, [err for _, err in ended]
    return {(item[0], item[1], item[2]) for out, _ in ended for item in json.loads(out)["got"]}


@pytest.mark.slow
def test_the_same_messages_arrive_in_virtual_time_over_zenoh_and_over_udp(tmp_path: Path, network: Network) -> None:
    path = _text(tmp_path / "letters.toml")
    expected = in_virtual_time(path)
    assert on_air(path, network) == expected
    assert asyncio.run(over_zenoh(path)) == expected


async def test_a_program_that_waits_for_the_end_of_its_swarm_has_a_whole_result() -> None:
    async with fanet_mw.launch("flooding", overrides=["duration_s=2", "nodes.count=2", *ONE]) as swarm:
        await swarm.wait()
    assert swarm.result is not None
    assert swarm.result.summary["aborted"] is None


async def test_who_waits_for_a_swarm_of_another_name_than_the_router_has_is_told_the_name(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """It waited for an hour without a word."""
    scenario, endpoint = fanet_mw.load_scenario("quick"), free_endpoint()
    with Bus.serve(endpoint) as bus:
        ClockKeeper(bus, Topics("mine"), time_scale=1.0, expected=("agent-1", "agent-2"), scenario=scenario)
        for swarm in ("mine", "quick"):
            with pytest.raises(TimeoutError):
                async with (
                    asyncio.timeout(4),
                    fanet_mw.join(scenario, node=1, radio=fanet_mw.Emulated(endpoint, swarm=swarm)),
                ):
                    pass
            said = capsys.readouterr().err
            assert ("agent-1 waits for swarm quick, which nobody serves there; served is mine" in said) == (
                swarm == "quick"
            ), said


LAUNCH = """import asyncio, fanet_mw
async def main():
    async with fanet_mw.launch("quick"): pass
asyncio.run(main())
"""


@pytest.mark.parametrize(
    ("program", "given"), [(LAUNCH, "-"), (f"if __name__ != '__main__': raise KeyError\n{LAUNCH}", "program.py")]
)
def test_a_program_that_its_processes_cannot_import_is_told_so_once(tmp_path: Path, program: str, given: str) -> None:
    """One on standard input, and one that raises when it is imported: each of eleven processes printed a traceback."""
    (tmp_path / "program.py").write_text(program)
    ended = subprocess.run(
        [sys.executable, given], input=program, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert ended.returncode == 1
    assert "HostError: the processes of a swarm import the program that launches it, and that ended" in ended.stderr
    assert ended.stderr.count("in _fixup_main_from_path") == 1


@pytest.mark.parametrize("left_out", [(), (1, 2)])
async def test_a_node_that_is_there_twice_ends_a_program_that_launches_and_is_named(left_out: tuple[int, ...]) -> None:
    """It waited for five minutes, and said that the router was gone."""

    async def join(swarm: fanet_mw.Launched) -> None:
        async with fanet_mw.join(swarm.scenario, node=1, radio=swarm.radio):
            pass

    with pytest.raises(fanet_mw.BusError, match=r"there twice: agent-1.*leave_out"):
        async with asyncio.timeout(30), fanet_mw.launch("quick", leave_out=left_out) as swarm:
            await asyncio.gather(join(swarm), join(swarm))


async def test_a_program_that_leaves_before_its_swarm_is_up_is_told_why_there_is_no_result() -> None:
    with pytest.raises(fanet_mw.BusError, match="before the swarm's time began: there is no result"):
        async with fanet_mw.launch("flooding", overrides=["nodes.count=2", *ONE]):
            pass


@pytest.mark.slow
def test_the_example_of_a_node_joins_from_its_wheel_and_is_answered_and_leaves_with_the_swarm(
    tmp_path: Path, installed: Installed, real_swarm: LaunchSwarm
) -> None:
    path = _text(tmp_path / "letters.toml")
    scenario = config.load(path, ["duration_s=6"])
    (tmp_path / "letters.toml").write_text(SCENARIO.replace("= 12", "= 6"), encoding="utf-8")

    async def run() -> str:
        async with real_swarm(scenario, leave_out=(1, 3)) as swarm:
            process = await asyncio.create_subprocess_exec(
                installed.python, str(EXAMPLES / "my-message" / "node.py"), str(path), swarm.radio.endpoint,
                stdout=subprocess.PIPE, cwd=tmp_path, env=installed.environment,
            )  # fmt: skip
            async with fanet_mw.join(scenario, node=3, radio=swarm.radio) as node:
                message = await node.receive()
                assert (await node.send(b"welcome", port=7, to=message.origin)).ok
                await asyncio.sleep(2)
                assert 1 in node.neighbors
            out, _ = await process.communicate()
            assert process.returncode == 0
        return out.decode()

    said = asyncio.run(run())
    assert "acknowledged=(3,)" in said
    assert "3 b'welcome'" in said


async def test_without_a_router_it_is_said_and_the_loss_of_one_ends_who_waits(tmp_path: Path) -> None:
    path = _text(tmp_path / "letters.toml")
    with pytest.raises(fanet_mw.BusError, match="no Zenoh router"):
        async with fanet_mw.join(path, node=1, radio=fanet_mw.Emulated("tcp/127.0.0.1:9", patience_s=0.3)):
            pass
    with pytest.raises(fanet_mw.ConfigError, match=r"node = 9: must be in \[1, nodes.count = 5\]"):
        async with fanet_mw.join(path, node=9):
            pass
    endpoint = free_endpoint()
    with Bus.serve(endpoint) as router:
        keeper = ClockKeeper(router, Topics("letters"), time_scale=1.0, expected=("agent-1",))
        clock = asyncio.ensure_future(keeper.start(timeout_s=60))
        async with fanet_mw.join(path, node=1, radio=fanet_mw.Emulated(endpoint, patience_s=60)) as node:
            await clock
            router.close()
            with pytest.raises(fanet_mw.BusError, match="is gone"):
                await asyncio.wait_for(node.receive(), 20)


def test_a_program_that_leaves_straight_after_it_has_received_has_sent_its_receipt(
    tmp_path: Path, real_swarm: LaunchSwarm
) -> None:
    scenario = config.load(_text(tmp_path / "letters.toml"), ["duration_s=6", "radio.lead_ms=150"])

    async def leave_when_told(radio: fanet_mw.Emulated) -> bytes:
        async with fanet_mw.join(scenario, node=3, radio=radio) as node:
            return (await node.receive()).data

    async def run() -> tuple[fanet_mw.Sent, bytes, float]:
        async with real_swarm(scenario, leave_out=(1, 3)) as swarm:
            leaving = asyncio.create_task(leave_when_told(swarm.radio))
            async with fanet_mw.join(scenario, node=1, radio=swarm.radio) as node:
                sent = await node.send(b"bye", port=7, to=3, lifetime_s=3)
                data = await leaving
                return sent, data, node.now_s

    sent, data, ended_s = asyncio.run(run())
    assert (sent.ok, data) == (True, b"bye")
    assert ended_s < 4, "it does not wait for the end of the swarm's time"
