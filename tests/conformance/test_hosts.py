"""The host contract, run against both hosts with the same actors: what an actor may rely on, whoever runs it."""

import asyncio
from collections.abc import Callable

import pytest

from fanet_mw.actor import Actor
from fanet_mw.bus.messages import MavlinkTap, Message
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import Bus
from fanet_mw.hosts.clock import ClockKeeper
from fanet_mw.hosts.realtime import RealtimeHost
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.units import MS
from sim.run.launcher.swarm import free_endpoint

NAMES = Topics("contract")
DURATION_NS = 600 * MS
Run = Callable[[list[Actor]], None]


class Watched(Actor):
    """Notes every call."""

    def __init__(self, name: str, hears: tuple[str, ...] = ()) -> None:
        super().__init__(name, hears)
        self.calls: list[tuple[str, int]] = []
        self.heard: list[bytes] = []
        self.wakes_ns: list[int] = []

    def start(self, now_ns: int) -> None:
        self.calls.append(("start", now_ns))

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        assert isinstance(message, MavlinkTap)
        self.calls.append(("receive", now_ns))
        self.heard.append(message.data)

    def wake(self, now_ns: int) -> None:
        self.calls.append(("wake", now_ns))
        self.wakes_ns = [t for t in self.wakes_ns if t > now_ns]

    def next_wake_ns(self) -> int | None:
        return self.wakes_ns[0] if self.wakes_ns else None

    def stop(self, now_ns: int) -> None:
        self.calls.append(("stop", now_ns))

    def say(self, data: bytes) -> None:
        self.outbox.append((NAMES.mavlink(1), MavlinkTap(0, data)))


class Speaker(Watched):
    """Says its name and a number at each wake-up, and goodbye at the end."""

    def wake(self, now_ns: int) -> None:
        super().wake(now_ns)
        for part in range(3):
            self.say(f"{len(self.calls)}.{part}".encode())


def virtual(actors: list[Actor]) -> None:
    host = VirtualHost(actors)
    host.start()
    host.run(DURATION_NS)
    host.stop()


def realtime(actors: list[Actor]) -> None:
    async def main() -> None:
        endpoint = free_endpoint()
        with Bus.serve(endpoint) as router:
            keeper = ClockKeeper(router, NAMES, time_scale=1.0, expected=[actor.name for actor in actors])
            buses = [Bus.join(endpoint) for _ in actors]
            hosts = [RealtimeHost(actor, bus, NAMES) for actor, bus in zip(actors, buses, strict=True)]
            running = [asyncio.create_task(host.run(until_ns=DURATION_NS, clock_timeout_s=5)) for host in hosts]
            await keeper.start(timeout_s=5)
            await asyncio.gather(*running)
            for bus in buses:
                bus.close()

    asyncio.run(main())


@pytest.fixture(params=[virtual, realtime], ids=["virtual", "realtime"])
def run(request: pytest.FixtureRequest) -> Run:
    chosen: Run = request.param
    return chosen


def test_start_comes_first_stop_last_and_instants_never_decrease(run: Run) -> None:
    actor = Watched("only")
    actor.wakes_ns = [50 * MS, 120 * MS]
    run([actor])
    names = [name for name, _ in actor.calls]
    instants = [t for _, t in actor.calls]
    assert names == ["start", "wake", "wake", "stop"]
    assert instants == sorted(instants)
    assert instants[0] >= 0


def test_no_wake_comes_before_its_instant(run: Run) -> None:
    actor = Watched("only")
    wanted = [k * 7 * MS + 123 for k in range(1, 40)]
    actor.wakes_ns = list(wanted)
    run([actor])
    woken = [t for name, t in actor.calls if name == "wake"]
    assert len(woken) <= len(wanted)
    for due in wanted:
        assert any(due <= t for t in woken)
    assert woken[0] >= wanted[0]


def test_messages_of_one_sender_arrive_whole_and_in_order(run: Run) -> None:
    listener, speaker = Watched("listener", (NAMES.mavlink("*"),)), Speaker("speaker")
    speaker.wakes_ns = [200 * MS, 300 * MS, 400 * MS]
    run([listener, speaker])
    wakes = [index + 1 for index, (name, _) in enumerate(speaker.calls) if name == "wake"]
    assert listener.heard == [f"{wake}.{part}".encode() for wake in wakes for part in range(3)]


class Patient(Watched):
    """Can wait for messages until it is woken anyway."""

    slack_ns = 100 * MS
    patient = (NAMES.mavlink(1),)


@pytest.mark.parametrize("wakes", [[], [150 * MS, 290 * MS, 430 * MS]], ids=["never woken", "woken"])
def test_a_patient_actor_hears_all_in_order_at_most_its_slack_late(run: Run, wakes: list[int]) -> None:
    patient, speaker = Patient("patient", (NAMES.mavlink("*"),)), Speaker("speaker")
    patient.wakes_ns = list(wakes)
    speaker.wakes_ns = [200 * MS, 220 * MS, 320 * MS]
    run([patient, speaker])
    assert patient.heard == [f"{said}.{part}".encode() for said in (2, 3, 4) for part in range(3)]
    heard_ns = [at_ns for name, at_ns in patient.calls if name == "receive"][::3]
    for said_ns, at_ns in zip([200 * MS, 220 * MS, 320 * MS], heard_ns, strict=True):
        assert at_ns <= said_ns + Patient.slack_ns + 100 * MS, "the rest is for a busy machine"


def test_what_a_patient_actor_hears_costs_no_wake_up_of_its_process_when_one_is_due() -> None:
    patient, speaker = Patient("patient", (NAMES.mavlink("*"),)), Speaker("speaker")
    patient.wakes_ns = [290 * MS]
    speaker.wakes_ns = [310 * MS]
    realtime([patient, speaker])
    at = dict(patient.calls)
    assert at["receive"] >= 390 * MS
    assert at["wake"] - at["receive"] < 50 * MS


def test_an_actor_hears_only_what_it_subscribed_to(run: Run) -> None:
    deaf, speaker = Watched("deaf", (NAMES.mavlink(2), NAMES.pose)), Speaker("speaker")
    speaker.wakes_ns = [200 * MS]
    run([deaf, speaker])
    assert deaf.heard == []


def test_a_wake_asked_for_in_the_past_comes_at_once(run: Run) -> None:
    actor = Watched("only")
    actor.wakes_ns = [-5]
    run([actor])
    assert [name for name, _ in actor.calls] == ["start", "wake", "stop"]
