"""A hello at the UAV that hears it: decoded once, for its clock, its protocol and its applications together."""

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from agents.clock.clocked_uav import ClockedUav, make_uav
from fanet_mw import wire
from fanet_mw.bus.messages import Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, NodeId, S

NAMES = Topics("h")
LEADER, OTHER = NodeId(1), NodeId(2)
EVERYTHING = {
    "nodes.count": 3,
    "clock.sync": "beacons",
    "clock.drift_ppm": 20,
    "clusters.relay": "counter",
    "clusters.repair_s": 10,
    "mission.search": "lines",
    "mission.collision_horizon_s": 15,
    "mission.collision_distance_m": 10,
}
"""Hellos then say where their sender flies, what it holds, what time it is and what it has found."""
MakeScenario = Callable[..., Scenario]


def uav(make_scenario: MakeScenario, node: NodeId, **keys: Any) -> ClockedUav:
    made = make_uav(make_scenario(**EVERYTHING | keys), node, "h", position=Enu(10.0 * node, 0.0, 50.0))
    assert isinstance(made, ClockedUav)
    made.start(0)
    return made


def hellos(made: ClockedUav, *, until_ns: int) -> Iterator[TxRequest]:
    """The hellos of a UAV that nobody answers, each after the radio has said that the one before has left."""
    while (wake_ns := made.next_wake_ns()) is not None and wake_ns < until_ns:
        made.wake(wake_ns)
        put_out, made.outbox = made.outbox, []
        for _, message in put_out:
            if isinstance(message, TxRequest):
                if wire.peek_kind(message.frame) == wire.Kind.HELLO:
                    yield message
                done = TxStatus(message.seq, TxOutcome.SENT, message.start_ns + MS, 1)
                made.receive(NAMES.radio_rx(made._node), done, message.start_ns + MS)


def messages(frame: bytes) -> set[int]:
    return {message for message, _ in wire.inner_frames(frame)}


def hello_with_time(make_scenario: MakeScenario, **keys: Any) -> TxRequest:
    sender = uav(make_scenario, LEADER, **keys)
    return next(hello for hello in hellos(sender, until_ns=30 * S) if wire.TIME.msgid in messages(hello.frame))


@contextmanager
def counted_calls() -> Iterator[Counter[str]]:
    """How often each function was called, by its qualified name."""
    calls: Counter[str] = Counter()

    def note(frame: FrameType, event: str, argument: Any) -> None:
        if event == "call":
            calls[frame.f_code.co_qualname] += 1
        elif event == "c_call":
            calls[argument.__name__] += 1

    sys.setprofile(note)
    try:
        yield calls
    finally:
        sys.setprofile(None)


def test_a_hello_is_decoded_once_per_reception(make_scenario: MakeScenario) -> None:
    hearer = uav(make_scenario, OTHER)
    hello = hello_with_time(make_scenario)
    frame, end_ns = bytes(bytearray(hello.frame)), hello.start_ns + MS
    reception = Reception(frame, LEADER, end_ns, -60.0)
    with counted_calls() as calls:
        hearer.receive(NAMES.radio_rx(OTHER), reception, end_ns)
    ours = sum(message in wire_ids() for message, _ in wire.inner_frames(frame))
    assert ours >= 3, "the hello has to carry something of each kind"
    assert calls["mcrf4xx"] == 1 + ours + 1, "its header, each message in it and its position are checked once"
    assert calls["checked"] == 1
    assert calls["Content.of"] == 1
    decoders = {name: count for name, count in calls.items() if name.endswith((".decode_frame", ".decode_frames"))}
    assert set(decoders) == {
        "Beacon.decode_frame", "Digest.decode_frames", "TimeBeacon.decode_frame",
    }  # fmt: skip
    assert set(decoders.values()) == {1}
    assert calls["kinematics_of"] == calls["told_in"] == 1


def wire_ids() -> set[int]:
    return {spec.msgid for spec in wire.SPECS}


def test_what_the_node_does_not_believe_reaches_no_application(make_scenario: MakeScenario) -> None:
    """A hello that another node sends in the leader's name is counted, and its sender is no neighbor."""
    hearer = uav(make_scenario, OTHER)
    hello = hello_with_time(make_scenario)
    end_ns = hello.start_ns + MS
    hearer.receive(NAMES.radio_rx(OTHER), Reception(hello.frame, NodeId(3), end_ns, -60.0), end_ns)
    assert hearer.report()["dropped"] == {"forged": 1}
    assert hearer.state(end_ns).neighbors == ()
    hearer.receive(NAMES.radio_rx(OTHER), Reception(hello.frame, LEADER, end_ns, -60.0), end_ns)
    assert hearer.state(end_ns).neighbors == (LEADER,)


def test_a_hello_without_room_for_the_time_goes_without_it(make_scenario: MakeScenario) -> None:
    whole = len(hello_with_time(make_scenario).frame)
    sender = uav(make_scenario, LEADER, **{"radio.max_frame_bytes": whole - 1, "traffic.payload_bytes": 100})
    said = list(hellos(sender, until_ns=10 * S))
    assert len(said) >= 10
    assert all(len(hello.frame) < whole and wire.TIME.msgid not in messages(hello.frame) for hello in said)
    assert all(hello.wants_status for hello in said), "a shorter hello may have room again"


def test_with_exact_clocks_hellos_carry_no_time_and_ask_for_no_status(make_scenario: MakeScenario) -> None:
    sender = uav(make_scenario, LEADER, **{"clock.sync": "none"})
    said = list(hellos(sender, until_ns=5 * S))
    assert said
    assert all(wire.TIME.msgid not in messages(hello.frame) and not hello.wants_status for hello in said)
