"""The public interface, as a program and a notebook use it, in virtual time."""

import asyncio
import math
import re
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from pymavlink.generator import mavgen

import fanet_mw
from fanet_mw.dialect import fanet
from fanet_mw.testing.plugin import MakeSwarm

ROOT = Path(__file__).parents[2]

SURVIVOR = 53003
_DIALECT = """<?xml version="1.0"?>
<mavlink><version>3</version><dialect>9</dialect><messages>
<message id="54001" name="WATER_LEVEL"><description>A gauge.</description>
<field type="uint16_t" name="gauge">Which one.</field><field type="float" name="level">Level.</field></message>
</messages></mavlink>
"""
QUIET = [
    "traffic.arrivals=none",
    "nodes.telemetry_hz=0",
    "duration_s=40",
    "world.engine=kinematic",
    "mission.survivors=0",
]


async def test_what_one_node_sends_another_has_and_the_sender_knows(swarm: MakeSwarm) -> None:
    async with swarm("quick", overrides=QUIET) as s:
        a, b = s.node(1), s.node(3)
        sent = await a.send(b"hello", port=7, to=3)
        assert sent.ok
        assert sent.acknowledged == (3,)
        message = await b.receive()
        assert (message.origin, message.port, message.data) == (1, 7, b"hello")
        assert 0 < message.delay_ms < 1000 * s.now_s


async def test_to_several_to_all_and_mavlink(swarm: MakeSwarm) -> None:
    async with swarm("quick", overrides=QUIET) as s:
        nodes = {number: s.node(number, messages=(SURVIVOR,)) for number in (1, 2, 4)}
        await s.run_until(8)
        assert (await nodes[1].send(bytes(5000), port=7, to=(2, 4))).acknowledged == (2, 4)
        assert (await nodes[1].send(b"all", port=8)).fate is fanet_mw.Fate.LET_OUT
        survivor = fanet.MAVLink_fanet_survivor_message(1, 1, 0.0, 0.0, 0.0, -50.0, 2, 1)
        assert (await nodes[2].send(survivor, to=4, priority="report")).ok
        await s.run_for(5)
        got = {message.port: message for message in [await nodes[4].receive() for _ in range(3)]}
        assert (got[7].data, got[8].data) == (bytes(5000), b"all")
        assert got[None].origin == 2
        (heard,) = got[None].mavlink()
        assert (heard.get_type(), heard.survivor) == ("FANET_SURVIVOR", 1)
        assert got[7].mavlink() == []


async def test_a_node_knows_its_neighbors_and_its_clusters(swarm: MakeSwarm) -> None:
    async with swarm("quick", overrides=QUIET) as s:
        node = s.node(2)
        await s.run_until(15)
        assert node.neighbors
        assert 2 not in node.neighbors
        members = [member for cluster in node.clusters.values() for member in cluster]
        assert 2 in members
        assert all(head == cluster[0] for head, cluster in node.clusters.items())
        assert node.bound_ms is None
        assert node.report()["kind"] == "agent"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda s: s.cut(10), r"cut 10: the id of a node must be within \[1, 9\]"),
        (lambda s: s.cut(2, for_s=math.nan), "for_s = nan must be a number of seconds >= 0"),
        (lambda s: s.degrade(3, 3), "degrade degrade-3-3: a link has two different ends"),
        (lambda s: s.degrade(1, 2, loss_share=2), r"degrade degrade-1-2: loss_share = 2 must be in \[0, 1\]"),
    ],
)
async def test_a_fault_that_would_change_nothing_is_refused(
    swarm: MakeSwarm, change: Callable[[fanet_mw.VirtualSwarm], None], said: str
) -> None:
    async with swarm("quick", overrides=QUIET) as s:
        with pytest.raises(fanet_mw.ConfigError, match=said):
            change(s)


async def test_time_is_what_can_pass_and_ends(swarm: MakeSwarm) -> None:
    async with swarm("quick", overrides=[*QUIET, "duration_s=8", "warmup_s=1", "drain_s=1"]) as s:
        for wait in (s.run_until(math.nan), s.run_for(-1), s.run_until(lambda: False, timeout_s=-1)):
            with pytest.raises(fanet_mw.ConfigError, match="must be a number of seconds >= 0"):
                await wait
        await s.run_for(7.5)
        with pytest.raises(TimeoutError, match=r"wanted = 8 s: timeout_s = 0\.1 ends at 7\.6 s"):
            await s.run_until(8, timeout_s=0.1)
        with pytest.raises(TimeoutError, match="wanted = 9 s: the time ends at 8 s"):
            await s.run_until(9)
    async with swarm("quick", overrides=QUIET) as s:
        s.result()
        with pytest.raises(fanet_mw.NodeClosedError, match="time is over"):
            await s.run_for(1)


async def test_a_virtual_swarm_is_a_context_manager_that_ends_its_run() -> None:
    reported: list[int] = []

    class Reporter(fanet_mw.Application):
        def report(self) -> dict[str, int]:
            reported.append(self.port.node)
            return {}

    async with fanet_mw.VirtualSwarm("quick", overrides=QUIET, applications=lambda _: [Reporter()]) as swarm:
        node = swarm.node(1)
        await swarm.run_until(2)
        assert not reported
    assert reported, "the run has ended in order"
    assert swarm.result().summary["simulated_s"] == 2
    with pytest.raises(fanet_mw.NodeClosedError):
        await node.receive()
    with pytest.raises(KeyError):
        async with fanet_mw.VirtualSwarm("quick", overrides=QUIET) as swarm:
            raise KeyError("of the program")


async def test_what_is_always_true_is_nothing_to_wait_for(swarm: MakeSwarm) -> None:
    async def wanted() -> bool:
        return False

    async with swarm("quick", overrides=QUIET) as s:
        with pytest.raises(fanet_mw.ConfigError, match="must be no async function"):
            await s.run_until(wanted)  # type: ignore[arg-type]


async def test_a_node_whose_program_the_scenario_stops_knows_nothing_and_goes_on_when_it_is_started_again(
    swarm: MakeSwarm,
) -> None:
    stop = "faults=[{kind = 'stop', node = 3, at_s = 7, for_s = 3}]"
    async with swarm("quick", overrides=[*QUIET, stop]) as s:
        node, other = s.node(3), s.node(1)
        await s.run_until(6)
        assert node.neighbors
        await s.run_until(8)
        assert (node.neighbors, node.clusters, node.bound_ms) == ((), {}, None)
        assert (await node.send(b"later", port=7, to=1)).ok
        assert s.now_s > 10
        assert (await other.receive()).data == b"later"
        assert node.report()["kind"] == "agent"


async def test_faults_and_who_is_out_of_reach(swarm: MakeSwarm) -> None:
    async with swarm("quick", overrides=QUIET) as s:
        node, _, _ = s.node(1), s.node(2), s.node(9)
        await s.run_until(6)
        s.cut(9)
        sent = await node.send(b"anyone?", port=7, to=(2, 9), lifetime_s=20)
        assert (sent.fate, sent.lacking) == (fanet_mw.Fate.EXPIRED, (9,))
        assert (await node.send(b"nobody listens", port=7, to=4)).fate is fanet_mw.Fate.UNWANTED
        s.assert_ledger_closes()


@pytest.mark.parametrize(
    "options",
    [
        {"port": 0}, {"port": 70_000}, {"port": "7"}, {"port": None}, {"to": "everyone"}, {"to": 0}, {"to": 1},
        {"to": 77}, {"to": 3.5}, {"to": ()}, {"to": (2, 77)}, {"priority": "urgent"}, {"lifetime_s": -1},
        {"deadline_s": float("nan")}, {"deadline_s": "1 s"}, {"content": "text"}, {"content": object(), "port": None},
    ],
)  # fmt: skip
async def test_what_cannot_be_sent_is_said_with_its_value_before_time_passes(
    swarm: MakeSwarm, options: dict[str, Any]
) -> None:
    async with swarm("quick", overrides=QUIET) as s:
        with pytest.raises(fanet_mw.ConfigError, match=r"must be"):
            await s.node(1).send(**{"content": bytes(5), "port": 7, **options})
        assert s.now_s == 0


async def test_the_end_of_the_swarms_time_ends_who_listens_and_who_sends(swarm: MakeSwarm) -> None:
    async with swarm("quick", overrides=[*QUIET, "duration_s=9"]) as s:
        node = s.node(1)
        assert [message async for message in node] == []
        with pytest.raises(fanet_mw.NodeClosedError):
            await node.send(b"late", port=7)


async def test_tasks_that_wait_for_each_other_let_time_pass(swarm: MakeSwarm) -> None:
    async with swarm("quick", overrides=QUIET) as s:
        a, b = s.node(1), s.node(4)

        async def answer() -> None:
            async for message in b:
                await b.send(b"re: " + message.data, port=7, to=message.origin)

        task = asyncio.ensure_future(answer())
        await a.send(b"question", port=7, to=4)
        assert (await a.receive()).data == b"re: question"
        task.cancel()


async def test_join_takes_a_scenario_by_its_name_and_a_swarm_in_virtual_time_as_its_radio() -> None:
    swarm = fanet_mw.VirtualSwarm("quick")
    async with (
        fanet_mw.join("quick", node=2, radio=swarm) as a,
        fanet_mw.join(swarm.scenario, node=3, radio=swarm) as b,
    ):
        await a.send(b"x", port=9, to=3)
        assert (await b.receive()).origin == 2
        with pytest.raises(fanet_mw.ConfigError, match="before time passes"):
            async with fanet_mw.join(swarm.scenario, node=4, radio=swarm):
                pass
    with pytest.raises(fanet_mw.ConfigError, match="unknown scenario 'quik'; did you mean quick"):
        async with fanet_mw.join("quik", node=2, radio=swarm):
            pass


class Beacon(fanet_mw.Application):
    """Sends a number each second."""

    name = "beacon"
    ports = (4,)

    def __init__(self) -> None:
        self.due_ns, self.heard = 6_000_000_000, 0

    def next_wake_ns(self) -> int:
        return self.due_ns

    def wake(self, now_ns: int) -> None:
        self.due_ns += 1_000_000_000
        self.port.send(fanet_mw.Data(4, now_ns.to_bytes(8)))

    def on_message(self, message: fanet_mw.Received, now_ns: int) -> None:
        self.heard += 1

    def report(self) -> dict[str, int]:
        return {"heard": self.heard}


def test_a_simulation_gives_its_summary_its_trace_in_columns_and_its_deliveries() -> None:
    def run(seed: int) -> fanet_mw.Result:
        short = [*QUIET, "duration_s=16"]
        return fanet_mw.simulate("quick", applications=lambda _: [Beacon()], seed=seed, overrides=short)

    result, again, other = run(3), run(3), run(4)
    assert result.summary["trace_sha256"] == again.summary["trace_sha256"] != other.summary["trace_sha256"]
    assert result.summary["seed"] == 3
    sent = result.summary["applications"]["beacon"]["generated"]
    assert sent == 11 * result.summary["nodes"]
    columns = result.trace["delivered"]
    assert len(columns["node"]) == len(columns["delay_ns"]) == len(result.deliveries) > sent
    heard = sum(result.reports[f"agent-{n}"]["applications"]["beacon"]["heard"] for n in range(1, 10))
    assert heard == len(result.deliveries)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"applications": [fanet_mw.Application()]}, "must be a mapping by node, or be called with a node's id, not a"),
        ({"applications": lambda _: fanet_mw.Application()}, r"of node 1 = .* must be a sequence of Application"),
        ({"applications": lambda _: [fanet_mw.Application]}, r"of node 1 = .* must be a sequence of Application"),
        ({"applications": {10: ()}}, r"applications: node 10 must be in \[1, nodes.count = 9\]"),
        ({"applications": {"1": ()}}, r"applications: node '1' must be in \[1, nodes.count = 9\]"),
        ({"applications": {1: (one := [Beacon()]), 2: one}}, "of node 2: 'beacon' is that of node 1, must be its own"),
        ({"overrides": "duration_s=5"}, "must be a sequence of KEY=VALUE, not one text"),
        ({"overrides": 5}, "overrides = 5: must be a sequence of KEY=VALUE"),
        ({"overrides": [5]}, "--set 5: must be KEY=VALUE"),
        ({"seed": -1}, "seed = -1: input should be greater than or equal to 0"),
    ],
)
def test_what_cannot_be_simulated_is_said_with_its_value(options: dict[str, Any], said: str) -> None:
    with pytest.raises(fanet_mw.ConfigError, match=said):
        fanet_mw.simulate("quick", **options)


@pytest.mark.parametrize("given", [None, 5, b"quick", {"duration_s": 5}, ["quick"]])
def test_what_is_no_scenario_is_said_with_its_value(given: Any) -> None:
    for take in (fanet_mw.simulate, fanet_mw.load_scenario, fanet_mw.VirtualSwarm):
        with pytest.raises(fanet_mw.ConfigError, match=re.escape(f"scenario = {given!r}: must be a Scen")):
            take(given)


def test_overrides_of_a_loaded_scenario_are_a_sequence() -> None:
    with pytest.raises(fanet_mw.ConfigError, match="overrides = 'seed=3': must be a sequence of KEY=VALUE"):
        fanet_mw.load_scenario("quick", "seed=3")


def test_another_seed_is_that_of_the_scenario_built_or_named() -> None:
    built = fanet_mw.load_scenario("quick", QUIET)
    found = [fanet_mw.VirtualSwarm(built, seed=7), fanet_mw.VirtualSwarm("quick", overrides=QUIET, seed=7)]
    assert [swarm.scenario for swarm in found] == [fanet_mw.load_scenario("quick", [*QUIET, "seed=7"])] * 2
    with pytest.raises(fanet_mw.ConfigError, match="seed = -1: "):
        fanet_mw.simulate(built, seed=-1)


@pytest.mark.parametrize("radio", ["tcp/127.0.0.1:7447", fanet_mw.Emulated])
async def test_what_is_no_radio_is_said_with_its_value(radio: Any) -> None:
    with pytest.raises(fanet_mw.ConfigError, match=r"radio = .*: must be Emulated\(endpoint\), OnAir"):
        async with fanet_mw.join("quick", node=1, radio=radio):
            pass


async def test_a_node_that_there_is_not_cannot_be_left_out() -> None:
    with pytest.raises(fanet_mw.ConfigError, match=r"leave_out: node 77 must be in \[1, nodes.count = 9\]"):
        async with fanet_mw.launch("quick", leave_out=[77]):
            pass


@pytest.mark.parametrize("page", ["README.md", "docs/how-to/send-messages.md"])
def test_the_program_on_a_page_runs_as_it_stands(page: str, capsys: pytest.CaptureFixture[str]) -> None:
    [program] = [code for code in python_on(page) if "def test_" not in code]
    exec(compile(program, page, "exec"), {})
    assert capsys.readouterr().out.strip()


async def test_the_test_on_a_page_passes_as_it_stands(swarm: MakeSwarm) -> None:
    page = "docs/how-to/send-messages.md"
    [code] = [code for code in python_on(page) if "def test_" in code]
    names: dict[str, Any] = {}
    exec(compile(code, page, "exec"), names)
    [test] = [value for name, value in names.items() if name.startswith("test_")]
    await test(swarm)


def python_on(page: str) -> list[str]:
    """The pieces of Python on a page."""
    return re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def test_importing_fanet_mw_loads_nothing_else_and_all_names_are_there() -> None:
    code = (
        "import sys, fanet_mw; heavy = {'numpy', 'pydantic', 'zenoh', 'pymavlink', 'sim', 'agents'} & set(sys.modules);"
        "assert not heavy, heavy; assert all(getattr(fanet_mw, name) is not None for name in fanet_mw.__all__)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert set(fanet_mw.__all__) <= set(dir(fanet_mw))


async def test_messages_of_a_dialect_of_ones_own_arrive_as_what_they_are(
    swarm: MakeSwarm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.xml").write_text(_DIALECT, encoding="utf-8")
    options = mavgen.Opts(str(tmp_path / "mine_of_test.py"), wire_protocol="2.0", language="Python3", validate=False)
    assert mavgen.mavgen(options, [str(tmp_path / "mine.xml")])
    monkeypatch.syspath_prepend(tmp_path)
    mine = import_module("mine_of_test")

    async with swarm("quick", overrides=QUIET) as s:
        a, b = s.node(1), s.node(3, messages=[54001])
        assert (await a.send(mine.MAVLink_water_level_message(42, 1.5), to=3)).ok
        message = await b.receive()
    ((known,), (unknown,)) = message.mavlink(mine), message.mavlink()
    assert (known.get_type(), known.gauge, known.level) == ("WATER_LEVEL", 42, 1.5)
    assert unknown.get_type() == "UNKNOWN_54001"
    broken = message.data[:-1] + bytes([message.data[-1] ^ 1])
    with pytest.raises(fanet_mw.MalformedFrameError, match="CRC"):
        message._replace(data=broken).mavlink(mine)
    with pytest.raises(fanet_mw.LocalProtocolError, match="must be a module that pymavlink has generated"):
        message.mavlink(asyncio)
