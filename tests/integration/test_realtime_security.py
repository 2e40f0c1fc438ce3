"""Keys and access lists with real Zenoh sessions: the rights of each participant, and a swarm that runs under them."""

import asyncio
import shutil
import subprocess
import sys
import time
from array import array
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from undisturbed import LIMIT_S, undisturbed

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import (
    ClockEpoch,
    ClockState,
    Gps,
    MavlinkTap,
    Message,
    Poses,
    Reception,
    Report,
    Setpoint,
    TraceBatch,
    TxRequest,
)
from fanet_mw.bus.radio_control import Jam
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError, ConfigError
from fanet_mw.hosts.bus import Bus, exposure
from fanet_mw.hosts.clock import ClockKeeper, ClockListener
from fanet_mw.hosts.timebase import THIS_MACHINE
from fanet_mw.units import BROADCAST, Enu, NodeId, S
from sim.bus.rights import make
from sim.results.outcome import Outcome
from sim.run.launcher.swarm import free_endpoint, launch
from sim.scenarios import catalog

NAMES = Topics("test")
SMALL = [
    "nodes.count=4", "clusters.count=1", "duration_s=7", "warmup_s=4", "drain_s=1", "clusters.flooding_period_s=0.5",
    "radio.lead_ms=150",
]  # fmt: skip
"""The timetable is in force before the warm-up ends: within 4 s with 24 of 24 seeds, within 1 s with 16."""
SETTLE_S = 0.5

pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl")


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys")
    assert make(catalog.find("quick", SMALL), folder, swarm="test") == 4 + 5
    return folder


@contextmanager
def sessions(keys: Path, *names: str) -> Iterator[dict[str, Bus]]:
    """A router, and these participants with their own keys."""
    endpoint = free_endpoint("tls")
    with ExitStack() as stack:
        found = {"router": stack.enter_context(Bus.serve(endpoint, keys / "router.json5"))}
        for name in names:
            found[name] = stack.enter_context(Bus.join(endpoint, keys / f"{name}.json5", patience_s=30))
        yield found


def put_until(said: Callable[[], None], heard: list[tuple[str, str]], expected: set[tuple[str, str]]) -> None:
    """Say everything again and again until all that is let through has come: sessions hear of each other in their own
    time. What is denied was put before what is allowed, and had its time by then."""
    for _ in range(120):
        said()
        time.sleep(SETTLE_S)
        if expected <= set(heard):
            break
    said()
    time.sleep(SETTLE_S)


OURS: dict[str, Message] = {
    NAMES.radio_tx(1): TxRequest(0, S, b"frame", BROADCAST, wants_status=False),
    NAMES.setpoint(1): Setpoint(S, Enu(1, 2, 3), 5.0),
    NAMES.mavlink(1): MavlinkTap(S, b""),
    NAMES.trace("agent-1"): TraceBatch(()),
    NAMES.report("agent-1"): Report("agent-1", S, "{}"),
}
"""What agent 1 may put."""
NOT_OURS: dict[str, Message] = {
    NAMES.clock: ClockEpoch(0, 1.0, ClockState.STOPPED),
    NAMES.radio_control: Jam("jam", Enu(0, 0, 0), 100.0, -50.0),
    NAMES.pose: Poses(S, array("H"), array("d")),
    NAMES.obstruction: Setpoint(S, Enu(1, 2, 3), 5.0),
    NAMES.radio_tx(2): TxRequest(0, S, b"frame", BROADCAST, wants_status=False),
    NAMES.radio_rx(2): Reception(b"frame", NodeId(1), S, -50.0),
    NAMES.radio_rx(1): Reception(b"frame", NodeId(2), S, -50.0),
    NAMES.radio_links: Setpoint(S, Enu(1, 2, 3), 5.0),
    NAMES.sensor(2, "gps"): Gps(S, Enu(1, 2, 3), Enu(0, 0, 0)),
    NAMES.setpoint(2): Setpoint(S, Enu(1, 2, 3), 5.0),
    NAMES.mavlink(2): MavlinkTap(S, b""),
    NAMES.operator(2): MavlinkTap(S, b""),
    NAMES.operator(1): MavlinkTap(S, b""),
    NAMES.trace("agent-2"): TraceBatch(()),
    NAMES.trace("emulator"): TraceBatch(()),
    NAMES.report("agent-2"): Report("agent-2", S, "{}"),
    NAMES.report("emulator"): Report("emulator", S, "{}"),
    NAMES.report("world"): Report("world", S, "{}"),
    "elsewhere/topic": MavlinkTap(S, b""),
}
"""What it might like to put: forged clock, jam, poses, and whatever is another's."""


def test_an_agent_is_heard_on_its_own_topics_and_on_no_other(keys: Path) -> None:
    heard: list[tuple[str, str]] = []
    with sessions(keys, "agent-1", "agent-2", "emulator", "world", "operator") as bus:
        for name, session in bus.items():
            if name != "agent-1":  # within one session nothing passes the access list
                for expression in ("fanet/test/**", *OURS, *NOT_OURS):
                    session.subscribe(expression, lambda topic, _, name=name: heard.append((name, topic)))

        def say() -> None:
            for topic, message in {**NOT_OURS, **OURS}.items():
                bus["agent-1"].put(topic, codecs.encode([message]), reliable=True)

        let_through = {
            NAMES.radio_tx(1): "emulator", NAMES.setpoint(1): "world", NAMES.mavlink(1): "operator",
            NAMES.trace("agent-1"): "operator", NAMES.report("agent-1"): "operator",
        }  # fmt: skip
        expected = {(name, topic) for topic, name in let_through.items()} | {("router", topic) for topic in OURS}
        put_until(say, heard, expected)
    assert set(heard) == expected, "a denied put is silent, and comes nowhere"


def test_an_agent_hears_what_is_for_it_and_nothing_of_the_others(keys: Path) -> None:
    heard: list[tuple[str, str]] = []
    with sessions(keys, "agent-1", "emulator", "world", "operator", "gateway") as bus:
        for topic in (*OURS, *NOT_OURS):
            bus["agent-1"].subscribe(topic, lambda topic, _: heard.append(("", topic)))
        bus["agent-1"].subscribe("fanet/test/**", lambda topic, _: heard.append(("", topic)))
        bus["agent-1"].subscribe(NAMES.sensors(1), lambda topic, _: heard.append(("", topic)))
        time.sleep(SETTLE_S)
        payload = codecs.encode([MavlinkTap(S, b"")])
        says = {
            "emulator": (NAMES.radio_rx(1), NAMES.radio_rx(2), NAMES.trace("emulator"), NAMES.report("emulator")),
            "world": (NAMES.pose, NAMES.sensor(1, "gps"), NAMES.sensor(2, "gps"), NAMES.report("world")),
            "operator": (NAMES.radio_control, NAMES.operator(1)),
            "gateway": (NAMES.operator(1), NAMES.operator(2), NAMES.setpoint(1)),
            "router": (NAMES.clock,),
        }

        def say() -> None:
            for name, said in says.items():
                for topic in said:
                    bus[name].put(topic, payload, reliable=True)

        expected = {
            ("", topic) for topic in (NAMES.radio_rx(1), NAMES.sensor(1, "gps"), NAMES.operator(1), NAMES.clock)
        }
        put_until(say, heard, expected)
    assert set(heard) == expected


def test_who_has_no_key_of_this_swarm_is_not_let_in(keys: Path, tmp_path: Path) -> None:
    make(catalog.find("quick", ["nodes.count=1", "clusters.count=1"]), tmp_path, swarm="test")
    endpoint = free_endpoint("tls")
    with Bus.serve(endpoint, keys / "router.json5"):
        for config in (tmp_path / "agent-1.json5", None):
            with pytest.raises(BusError, match="no Zenoh router"), Bus.join(endpoint, config, patience_s=1):
                pass
        with pytest.raises(BusError), Bus.join(endpoint.replace("tls/", "tcp/"), patience_s=1):
            pass


@pytest.mark.parametrize(("off_s", "said"), [(-3600, True), (0, False), (400 * 86_400, True)])
def test_a_clock_by_which_the_certificates_are_not_valid_is_named(
    keys: Path, monkeypatch: pytest.MonkeyPatch, off_s: int, *, said: bool
) -> None:
    """Zenoh says of a refused certificate what it says of a router that does not answer."""
    off = THIS_MACHINE._replace(unix_ns=lambda: time.time_ns() + off_s * S)
    monkeypatch.setattr("fanet_mw.hosts.bus.THIS_MACHINE", off)
    with pytest.raises(BusError) as caught:
        Bus.join(free_endpoint("tls"), keys / "agent-1.json5", patience_s=0.2)
    assert ("its certificates are valid from" in str(caught.value)) is said
    assert "no Zenoh router at tls/127.0.0.1:" in str(caught.value)


def test_a_router_by_whose_clock_its_certificates_are_not_valid_does_not_wait_for_anybody(
    keys: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    off = THIS_MACHINE._replace(unix_ns=lambda: time.time_ns() - 3600 * S)
    monkeypatch.setattr("fanet_mw.hosts.bus.THIS_MACHINE", off)
    with pytest.raises(BusError, match=r"cannot serve on tls/.*: the clock of this machine says .* valid from"):
        Bus.serve(free_endpoint("tls"), keys / "router.json5")


async def test_an_agent_cannot_answer_for_the_keeper_of_the_clock(keys: Path) -> None:
    forged = ClockEpoch(123, 2.0, ClockState.STOPPED)
    with sessions(keys, "agent-1", "agent-2") as bus:
        keeper = ClockKeeper(bus["router"], NAMES, time_scale=1.0, expected=())
        bus["agent-1"].answer(NAMES.clock, lambda: codecs.encode([forged]))
        await asyncio.sleep(SETTLE_S)
        listener = ClockListener(bus["agent-2"], NAMES)
        started = await keeper.start(timeout_s=60)
        clock = await listener.running(timeout_s=60)
        assert clock.epoch_unix_ns == started.epoch_unix_ns
        keeper.stop()
        await asyncio.wait_for(listener.stopped.wait(), 60)


@pytest.mark.timeout(LIMIT_S)
def test_a_swarm_of_processes_works_with_keys_and_access_lists(keys: Path) -> None:
    def run(slower: str) -> Outcome:
        return asyncio.run(launch(catalog.find("quick", [*SMALL, slower]), swarm="test", zenoh_config=keys))

    _, summary = undisturbed(run)
    assert summary["absent"] == {}
    assert summary["heard"]["malformed"] == 0
    assert summary["frames"]["sent"] > 30
    assert summary["frames"]["closes"]
    assert summary["pdr"] > 0.9


def test_a_file_that_is_no_configuration_is_one_message(tmp_path: Path) -> None:
    (tmp_path / "bad.json5").write_text("{ nonsense: ")
    for path in (tmp_path / "bad.json5", tmp_path / "none.json5"):
        with pytest.raises(ConfigError, match=rf"--zenoh-config {path}: "):
            Bus.join("tls/127.0.0.1:1", path)


@pytest.mark.parametrize(
    ("endpoint", "warned"),
    [
        ("tcp/127.0.0.1:7447", False),
        ("tcp/[::1]:7447", False),
        ("tcp/localhost:7447", False),
        ("tls/0.0.0.0:7447", False),
        ("tcp/0.0.0.0:7447", True),
        ("tcp/[::]:7447", True),
        ("udp/10.0.0.1:7447", True),
        ("tcp/ground-station.local:7447", True),
    ],
)
def test_an_endpoint_that_others_can_reach_is_warned_of(endpoint: str, warned: bool) -> None:
    for listens in (True, False):
        assert (exposure(endpoint, listens=listens) is not None) == warned


def test_the_router_says_so() -> None:
    command = [sys.executable, "-m", "sim.cli.app", "router", "quick", "--listen"]
    nobodys = "tcp/192.0.2.1:1"  # for documentation (RFC 5737): no machine can listen there
    done = subprocess.run([*command, nobodys], capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 2
    assert f"{nobodys} is neither on the loopback interface nor encrypted" in " ".join(done.stderr.split())
