"""What the real-time host adds to the contract: clock, loss of the router, crashes, lateness. Real sessions, short."""

import asyncio
import json
import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.actor import Actor
from fanet_mw.bus import codecs
from fanet_mw.bus.messages import ClockEpoch, ClockState, MavlinkTap, Message, Reception, Report, TraceBatch
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError
from fanet_mw.hosts import bus as bus_module
from fanet_mw.hosts.bus import Bus
from fanet_mw.hosts.clock import ClockKeeper, ClockListener, SwarmClock
from fanet_mw.hosts.realtime import SwarmAddress, run_actor
from fanet_mw.hosts.timebase import THIS_MACHINE, Timebase
from fanet_mw.hosts.wake_lateness import DurationHistogram
from fanet_mw.trace import ProcessEnded
from fanet_mw.units import MS, NodeId, S
from sim.run.launcher.swarm import free_endpoint

NAMES = Topics("host")
ROUTER = """
import sys, time
from fanet_mw.hosts.bus import Bus
with Bus.serve(sys.argv[1]):
    print("up", flush=True)
    time.sleep(60)
"""


class Ticker(Actor):
    """Wakes every 20 ms, records that it did, and says three things on one topic."""

    def __init__(self, name: str = "ticker", hears: tuple[str, ...] = ()) -> None:
        super().__init__(name, hears)
        self.next_ns = 0
        self.wakes = 0
        self.heard: list[Message] = []
        self.stopped_ns: int | None = None

    def start(self, now_ns: int) -> None:
        self.next_ns = now_ns

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        self.heard.append(message)

    def wake(self, now_ns: int) -> None:
        self.wakes += 1
        self.next_ns = now_ns + 20 * MS
        self.records.append(ProcessEnded(now_ns, 0, self.name, self.wakes))
        self.outbox += [(NAMES.mavlink(7), MavlinkTap(now_ns, b"said"))] * 3

    def next_wake_ns(self) -> int | None:
        return self.next_ns

    def stop(self, now_ns: int) -> None:
        self.stopped_ns = now_ns


class Fails(Ticker):
    """Raises at its third wake-up."""

    def wake(self, now_ns: int) -> None:
        super().wake(now_ns)
        if self.wakes == 3:
            raise RuntimeError("third wake-up")


class FailsOnMessage(Ticker):
    """Raises at the first message."""

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        raise RuntimeError("first message")


_PATIENCE_S = 60
"""How long to wait for what must come: far longer than it ever takes, because it may meet a busy machine."""


class Observer:
    """What a launcher would collect."""

    def __init__(self, bus: Bus) -> None:
        self.puts: list[tuple[str, list[Message]]] = []
        for expression in (NAMES.all_traces, NAMES.all_reports, NAMES.mavlink("*")):
            bus.subscribe(expression, lambda topic, payload: self.puts.append((topic, codecs.decode(payload))))

    def reports(self) -> list[dict[str, object]]:
        return [json.loads(m.json) for _, messages in self.puts for m in messages if isinstance(m, Report)]

    async def last_report(self) -> dict[str, Any]:
        """Figures of the host in its last report, as soon as that has come."""
        for _ in range(_PATIENCE_S * 20):
            if (reports := self.reports()) and reports[-1]["final"]:
                figures = reports[-1]["host"]
                assert isinstance(figures, dict)
                return figures
            await asyncio.sleep(0.05)
        raise AssertionError("the last report did not come")

    def codes(self) -> list[int]:
        batches = [m for _, messages in self.puts for m in messages if isinstance(m, TraceBatch)]
        return [record.exit_code for batch in batches for record in batch.records if isinstance(record, ProcessEnded)]


async def run(actor: Actor, *, until_ns: int, stop_after_s: float | None = None, say: bytes = b"") -> Observer:
    """One actor against a router of its own; `say` is put on its first subscription while it runs."""
    endpoint = free_endpoint()
    with Bus.serve(endpoint) as bus:
        observer = Observer(bus)
        keeper = ClockKeeper(bus, NAMES, time_scale=1.0, expected=[actor.name])
        host = asyncio.create_task(run_actor(actor, SwarmAddress("host", endpoint), until_ns=until_ns))
        clock = SwarmClock(await keeper.start(timeout_s=_PATIENCE_S))
        await asyncio.sleep(clock.wait_s(50 * MS))
        if say:
            bus.put(actor.subscriptions[0], say)
        if stop_after_s is not None:
            await asyncio.sleep(stop_after_s)
            keeper.stop()
        try:
            await host
        except RuntimeError:
            for _ in range(_PATIENCE_S * 20):  # what it still published arrives
                if len(observer.codes()) >= 2:
                    break
                await asyncio.sleep(0.05)
            actor.heard.append(observer)  # type: ignore[attr-defined]  # the test looks at it
            raise
        await observer.last_report()
        return observer


# --- running ----------------------------------------------------------------------------------------------------------


async def test_one_wake_up_is_one_put_per_topic_and_every_record_arrives_once() -> None:
    actor = Ticker()
    observer = await run(actor, until_ns=1400 * MS)
    said = [messages for topic, messages in observer.puts if topic == NAMES.mavlink(7)]
    assert actor.wakes > 10
    assert len(said) == actor.wakes
    assert {len(messages) for messages in said} == {3}
    assert observer.codes() == list(range(1, actor.wakes + 1))
    assert [report["final"] for report in observer.reports()] == [False, True]
    host = await observer.last_report()
    assert host["puts"] == actor.wakes
    assert host["wake_lateness_ms"]["count"] == actor.wakes
    assert host["uss_mb"] > 1


class Patient(Ticker):
    """May be woken up to an hour later than it asks for."""

    slack_ns = 3600 * S


async def test_an_actor_with_slack_is_woken_by_the_message_that_comes_after_its_instant() -> None:
    actor = Patient(hears=(NAMES.pose,))
    said = codecs.encode([Reception(b"now", NodeId(2), 0, -60.0)])
    observer = await run(actor, until_ns=600 * MS, say=said)
    assert len(actor.heard) == 1
    assert actor.wakes == 2, "at the start, because it is due then, and with the message"
    assert (await observer.last_report())["wake_lateness_ms"]["max"] == 0, "within its slack nothing is late"


async def test_an_actor_with_slack_is_woken_when_that_is_over_although_no_message_comes() -> None:
    actor = Ticker()
    actor.slack_ns = 180 * MS
    await run(actor, until_ns=1500 * MS)
    assert 2 <= actor.wakes <= 1500 // 200 + 1, "every 20 ms and the slack, or later"


class AsksForThePast(Ticker):
    """Asks for an instant ten seconds back, once."""

    def start(self, now_ns: int) -> None:
        self.next_ns = now_ns - 10 * S


async def test_an_instant_that_was_past_when_it_was_asked_for_is_not_the_hosts_lateness() -> None:
    actor = AsksForThePast()
    began_s = time.monotonic()
    observer = await run(actor, until_ns=600 * MS)
    host, took_ms = await observer.last_report(), 1000 * (time.monotonic() - began_s)
    assert actor.wakes > 3
    assert 10_000 <= host["asked_past_ms"] < 10_500 + host["stall_ms"]
    assert host["wake_lateness_ms"]["max"] < 500 + host["stall_ms"]
    assert host["stall_ms"] < max(500, took_ms), "what lay ten seconds back held nobody up"


class Accounts(Ticker):
    """Counts what others send, also what was on its way at the end."""

    hears_out = True


@pytest.mark.parametrize("actor", [Ticker(hears=(NAMES.pose,)), Accounts(hears=(NAMES.pose,))], ids=["node", "medium"])
async def test_what_was_on_its_way_at_the_end_is_counted_or_still_heard(
    actor: Ticker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fanet_mw.hosts.realtime._ON_ITS_WAY_S", 1.0)  # a busy machine wakes this test late, too
    endpoint, until_ns = free_endpoint(), 500 * MS
    with Bus.serve(endpoint) as bus:
        observer = Observer(bus)
        keeper = ClockKeeper(bus, NAMES, time_scale=1.0, expected=[actor.name])
        host = asyncio.create_task(run_actor(actor, SwarmAddress("host", endpoint), until_ns=until_ns))
        clock = SwarmClock(await keeper.start(timeout_s=_PATIENCE_S))
        await asyncio.sleep(clock.wait_s(until_ns + 30 * MS))
        bus.put(NAMES.pose, codecs.encode([Reception(b"last", NodeId(2), until_ns, -60.0)]))
        await host
        figures = await observer.last_report()
    assert figures["unread_receptions"] == 1
    assert len(actor.heard) == actor.hears_out
    assert actor.stopped_ns == until_ns


class HoldsUp(Ticker):
    """Keeps the loop from everything for 0.4 s, once."""

    def wake(self, now_ns: int) -> None:
        super().wake(now_ns)
        if self.wakes == 5:
            time.sleep(0.4)


async def test_a_host_that_could_do_nothing_for_a_while_says_for_how_long() -> None:
    began_s = time.monotonic()
    observer = await run(HoldsUp(), until_ns=1000 * MS)
    host, took_ms = await observer.last_report(), 1000 * (time.monotonic() - began_s)
    assert 250 < host["stall_ms"] < max(1000, took_ms)


async def test_a_stopped_clock_ends_the_actor_early_and_settles_it() -> None:
    actor = Ticker()
    began_s = time.monotonic()
    observer = await run(actor, until_ns=1000 * S, stop_after_s=0.3)
    assert actor.stopped_ns is not None
    assert 0.3 * S < actor.stopped_ns < max(3.0, time.monotonic() - began_s) * S
    assert observer.reports()[-1]["final"] is True


async def test_what_is_no_message_is_counted_and_changes_nothing() -> None:
    actor = Ticker(hears=(NAMES.pose,))
    observer = await run(actor, until_ns=400 * MS, say=b"\xff\x00 garbage")
    host = await observer.last_report()
    assert host["malformed"] == 1
    assert actor.heard == []


@pytest.mark.parametrize("actor", [Fails(), FailsOnMessage(hears=(NAMES.pose,))], ids=["wake", "receive"])
async def test_an_actor_that_raises_ends_its_host_at_once_and_its_records_survive_it(actor: Ticker) -> None:
    message = codecs.encode([MavlinkTap(0, b"")])
    with pytest.raises(RuntimeError, match=r"third wake-up|first message"):
        await run(actor, until_ns=1000 * S, say=message if actor.subscriptions else b"")
    observer = actor.heard[-1]
    assert isinstance(observer, Observer)
    assert observer.codes()[:2] == [1, 2]
    assert actor.stopped_ns is None, "what broke is not asked to settle"
    woken = actor.wakes
    await asyncio.sleep(0.1)
    assert actor.wakes == woken


# --- the router -------------------------------------------------------------------------------------------------------


@pytest.fixture
def router() -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A router in a process of its own, which a test may kill."""
    endpoint = free_endpoint()
    process = subprocess.Popen([sys.executable, "-c", ROUTER, endpoint], stdout=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stdout.readline() == b"up\n"
    yield endpoint, process
    process.kill()
    process.communicate()


@pytest.mark.parametrize("started", [True, False], ids=["running", "waiting for the clock"])
async def test_a_host_whose_router_dies_ends_soon(
    router: tuple[str, subprocess.Popen[bytes]], *, started: bool
) -> None:
    endpoint, process = router
    with Bus.join(endpoint) as bus:
        keeper = ClockKeeper(bus, NAMES, time_scale=1.0, expected=["ticker"])
        host = asyncio.create_task(run_actor(Ticker(), SwarmAddress("host", endpoint), until_ns=1000 * S))
        if started:
            await keeper.start(timeout_s=_PATIENCE_S)
        await asyncio.sleep(0.6)
        os.kill(process.pid, signal.SIGKILL)
        with pytest.raises(BusError, match=f"router at {endpoint} is gone"):
            await asyncio.wait_for(host, _PATIENCE_S)


async def test_a_router_that_is_slow_to_answer_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process of a swarm on a busy machine may be connected to long before the router has time for it."""
    monkeypatch.setattr(bus_module, "BUSY_PATIENCE_S", 0.2)
    endpoint = free_endpoint()
    port = int(endpoint.rpartition(":")[2])
    with socket.socket() as silent:
        silent.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        silent.bind(("127.0.0.1", port))
        silent.listen()
        with pytest.raises(BusError, match=r"no answer within 0\.5 s, although somebody listens there"):
            await asyncio.to_thread(Bus.join, endpoint, patience_s=0.3)
        monkeypatch.setattr(bus_module, "BUSY_PATIENCE_S", 20.0)
        joining = asyncio.create_task(asyncio.to_thread(Bus.join, endpoint, patience_s=0.3))
        await asyncio.sleep(1.5)
    with Bus.serve(endpoint), await joining as late:
        assert late.connected()


# --- the clock --------------------------------------------------------------------------------------------------------


class Machine:
    """The clocks of a machine that a test moves: time passes for both, a step is of the unix clock alone."""

    def __init__(self, machine: int, *, unix_ns: int = 1_700_000_000 * S, mono_ns: int = 5_000 * S) -> None:
        self.unix_ns, self.mono_ns = unix_ns, mono_ns
        self.timebase = Timebase(lambda: self.unix_ns, lambda: self.mono_ns, machine)

    def let_pass(self, seconds: float) -> None:
        self.unix_ns += round(seconds * S)
        self.mono_ns += round(seconds * S)

    def step(self, seconds: float) -> None:
        self.unix_ns += round(seconds * S)

    def clock(self) -> ClockEpoch:
        """What a keeper on this machine publishes when swarm instant 0 is now."""
        return ClockEpoch(self.unix_ns, 1.0, ClockState.RUNNING, self.mono_ns, self.timebase.machine)


STEPS = pytest.mark.parametrize("step_s", [-3600.0, -10.0, 10.0, 3600.0])


@STEPS
def test_a_step_of_the_systems_clock_moves_no_process_whenever_it_started(step_s: float) -> None:
    machine = Machine(7)
    told = machine.clock()
    early = SwarmClock(told, machine.timebase)
    machine.let_pass(20)
    machine.step(step_s)
    late = SwarmClock(told, machine.timebase)
    machine.let_pass(5)
    assert early.now_ns() == late.now_ns() == 25 * S
    assert late.epoch_unix_ns == told.epoch_unix_ns


def test_a_process_of_another_machine_goes_by_unix_time_and_its_own_monotonic_clock() -> None:
    keeper, other = Machine(7), Machine(8, mono_ns=1)
    told = keeper.clock()
    other.let_pass(20)
    clock = SwarmClock(told, other.timebase)
    assert clock.now_ns() == 20 * S
    other.let_pass(5)
    other.step(-10)
    assert clock.now_ns() == 25 * S, "read once, when it started"


def test_a_machine_that_cannot_be_told_is_never_taken_for_the_keepers() -> None:
    keeper, other = Machine(0), Machine(0, mono_ns=1)
    told = keeper.clock()
    other.let_pass(20)
    assert SwarmClock(told, other.timebase).now_ns() == 20 * S


@pytest.mark.parametrize("step_s", [-10.0, 10.0])
async def test_an_actor_that_starts_after_a_step_of_the_clock_joins_the_swarm_where_it_is(step_s: float) -> None:
    """By a clock that is off it would be ten seconds ahead of the swarm, or come in again at 0."""
    stepped = THIS_MACHINE._replace(unix_ns=lambda: time.time_ns() + round(step_s * S))
    endpoint, actor = free_endpoint(), Ticker()
    with Bus.serve(endpoint) as bus:
        observer = Observer(bus)
        keeper = ClockKeeper(bus, NAMES, time_scale=1.0, expected=[])
        clock = SwarmClock(await keeper.start(timeout_s=_PATIENCE_S))
        await asyncio.sleep(clock.wait_s(700 * MS))
        host = asyncio.create_task(
            run_actor(actor, SwarmAddress("host", endpoint), until_ns=1000 * S, timebase=stepped)
        )
        while actor.wakes < 6 and not host.done():  # noqa: ASYNC110  (real time passes)
            await asyncio.sleep(0.01)
        assert 700 * MS < actor.next_ns < clock.now_ns() + 100 * MS
        assert actor.wakes > 5
        keeper.stop()
        await host
        await observer.last_report()


def test_all_processes_of_this_machine_say_that_it_is_the_same_one() -> None:
    command = "from fanet_mw.hosts.timebase import THIS_MACHINE; print(THIS_MACHINE.machine)"
    said = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True).stdout
    assert int(said) == THIS_MACHINE.machine != 0


@pytest.mark.parametrize("scale", [0.25, 1.0, 4.0])
def test_a_scaled_clock_runs_and_waits_by_its_scale(scale: float) -> None:
    machine = Machine(7)
    clock = SwarmClock(machine.clock()._replace(time_scale=scale), machine.timebase)
    machine.let_pass(10)
    now_ns = clock.now_ns()
    assert now_ns == 10 * S * scale
    assert clock.wait_s(now_ns + 8 * S) == pytest.approx(8 / scale)


async def test_an_actor_follows_a_clock_that_slows_down_while_it_runs() -> None:
    """The keeper slows the clock to a tenth at 0.5 s; a wake-up that was asked for comes at its swarm instant."""
    endpoint, actor = free_endpoint(), Ticker()
    with Bus.serve(endpoint) as bus:
        observer = Observer(bus)
        keeper = ClockKeeper(bus, NAMES, time_scale=1.0, expected=[])
        clock = SwarmClock(await keeper.start(timeout_s=_PATIENCE_S))
        host = asyncio.create_task(run_actor(actor, SwarmAddress("host", endpoint), until_ns=1000 * S))
        await asyncio.sleep(clock.wait_s(500 * MS))
        clock.follow(keeper.pace(0.1))
        slowed_ns = clock.now_ns()
        await asyncio.sleep(1)
        assert slowed_ns < clock.now_ns() < slowed_ns + 500 * MS
        while actor.next_ns < slowed_ns + 100 * MS and not host.done():  # noqa: ASYNC110  (real time passes)
            await asyncio.sleep(0.01)
        assert actor.next_ns < clock.now_ns() + 40 * MS, "not ahead of the keeper's clock"
        keeper.stop()
        await host
        await observer.last_report()


async def test_an_actor_follows_a_clock_that_speeds_up_while_it_waits() -> None:
    """At a thousandth of real time the next wake-up would be 20 s away."""
    endpoint, actor = free_endpoint(), Ticker()
    with Bus.serve(endpoint) as bus:
        observer = Observer(bus)
        keeper = ClockKeeper(bus, NAMES, time_scale=0.001, expected=[])
        clock = SwarmClock(await keeper.start(timeout_s=_PATIENCE_S))
        host = asyncio.create_task(run_actor(actor, SwarmAddress("host", endpoint), until_ns=1000 * S))
        await asyncio.sleep(clock.wait_s(MS // 2))
        clock.follow(keeper.pace(1.0))
        began_s = time.monotonic()
        while actor.wakes < 10 and not host.done():  # noqa: ASYNC110  (real time passes)
            await asyncio.sleep(0.01)
        assert time.monotonic() < began_s + 10
        keeper.stop()
        await host
        await observer.last_report()


async def test_an_actor_ends_at_the_instant_that_the_keeper_says() -> None:
    endpoint, actor = free_endpoint(), Ticker()
    with Bus.serve(endpoint) as bus:
        observer = Observer(bus)
        keeper = ClockKeeper(bus, NAMES, time_scale=1.0, expected=[])
        clock = SwarmClock(await keeper.start(timeout_s=_PATIENCE_S))
        host = asyncio.create_task(run_actor(actor, SwarmAddress("host", endpoint), until_ns=1000 * S))
        await asyncio.sleep(clock.wait_s(300 * MS))
        keeper.end_at(900 * MS)
        await host
        assert actor.stopped_ns == 900 * MS
        await observer.last_report()


async def test_an_actor_leaves_with_an_error_when_a_second_keeper_starts_its_swarms_clock_anew() -> None:
    """So it is after a router was killed and started again, and where two swarms of one name share a router."""
    endpoint, actor = free_endpoint(), Ticker()
    with Bus.serve(endpoint) as bus:
        await ClockKeeper(bus, NAMES, time_scale=1.0, expected=[]).start(timeout_s=_PATIENCE_S)
        host = asyncio.create_task(run_actor(actor, SwarmAddress("host", endpoint), until_ns=1000 * S))
        while not actor.wakes:  # noqa: ASYNC110  (real time passes)
            await asyncio.sleep(0.01)
        await ClockKeeper(bus, NAMES, time_scale=1.0, expected=[]).start(timeout_s=_PATIENCE_S)
        with pytest.raises(BusError, match="the clock of swarm host was started anew"):
            await asyncio.wait_for(host, _PATIENCE_S)


async def test_whoever_comes_late_gets_the_clock_that_runs() -> None:
    endpoint = free_endpoint()
    with Bus.serve(endpoint) as bus:
        keeper = ClockKeeper(bus, NAMES, time_scale=2.0, expected=[])
        first = SwarmClock(await keeper.start(timeout_s=_PATIENCE_S))
        await asyncio.sleep(0.4)
        with Bus.join(endpoint) as late:
            clock = await ClockListener(late, NAMES).running(timeout_s=_PATIENCE_S)
        before_ns, now_ns, after_ns = first.now_ns(), clock.now_ns(), first.now_ns()
        assert before_ns - 5 * MS < now_ns < after_ns + 5 * MS
        assert now_ns > 0


async def test_a_hint_that_comes_when_the_session_is_closed_raises_nothing() -> None:
    """As a forged clock does, again and again, at the end of a run."""
    endpoint = free_endpoint()
    with Bus.serve(endpoint):
        with Bus.join(endpoint) as own:
            listener = ClockListener(own, NAMES)
        raised: list[object] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, context: raised.append(context))
        listener._on_hint(NAMES.clock, b"")
        await asyncio.sleep(0.1)
    assert raised == []


async def test_a_swarm_that_is_not_complete_is_not_started_and_names_who_is_missing() -> None:
    endpoint = free_endpoint()
    with Bus.serve(endpoint) as bus, Bus.join(endpoint) as one:
        keeper = ClockKeeper(bus, NAMES, time_scale=1.0, expected=["agent-1", "agent-2", "world"])
        one.announce(NAMES.alive("agent-1"))
        with pytest.raises(BusError, match=r"2 of the swarm did not come up within 0\.5 s: missing: agent-2, world"):
            await keeper.start(timeout_s=0.5)
        assert keeper.clock is None


# --- lateness ---------------------------------------------------------------------------------------------------------


@given(st.lists(st.integers(0, 10 * S), min_size=1), st.floats(0.01, 1))
def test_a_percentile_is_never_too_low_and_at_most_a_tenth_too_high(durations: list[int], share: float) -> None:
    histogram = DurationHistogram()
    for duration in durations:
        histogram.add(duration)
    true_ns = sorted(durations)[math.ceil(share * len(durations)) - 1]
    assert true_ns - 1 <= histogram.percentile_ns(share) <= max(1000, true_ns * 1.101 + 1)
    assert histogram.max_ns == max(durations)
