"""The actor contract, run against every actor of a swarm: hostile input is counted, time only goes on."""

from array import array
from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st
from kit import examples

from agents.clock.clocked_uav import make_uav
from agents.uav import Uav
from emulator.medium import Medium
from fanet_mw import wire
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import (
    Gps,
    MavlinkTap,
    Message,
    Poses,
    Reception,
    Setpoint,
    TxOutcome,
    TxRequest,
    TxStatus,
    WifiScan,
)
from fanet_mw.bus.radio_control import Cut, Degrade, Jam, Restore
from fanet_mw.bus.topics import Topics
from fanet_mw.routing.clustered.build import RELAYS
from fanet_mw.scenario import Clock, Scenario
from fanet_mw.scenario.tables.routing import PROTOCOLS
from fanet_mw.trace import Generated
from fanet_mw.units import MS, Enu, NodeId, S
from fanet_mw.wire.hello.beacon import TimeBeacon
from fanet_mw.wire.schedule import Join, Member, Schedule
from fanet_mw.wire.survivors import Survivor
from sim.scenarios import catalog
from sim.world.world import WorldActor

NAMES = Topics("contract")
SCENARIO = catalog.find("quick", ["world.engine=kinematic"])


def clocked(scenario: Scenario, sync: str) -> Scenario:
    """The same with clocks that are off."""
    clock = Clock.model_validate({"sync": sync, "offset_ms": 700, "drift_ppm": 20, "wander_ppm": 0.1})
    return scenario.model_copy(update={"clock": clock})


MAKERS: list[Callable[[Scenario], Actor]] = [
    lambda scenario: Uav(scenario, NodeId(1), "contract", position=Enu(0, 0, 50)),
    lambda scenario: Uav(scenario, NodeId(2), "contract", position=Enu(0, 0, 50)),
    lambda scenario: make_uav(clocked(scenario, "beacons"), NodeId(1), "contract", position=Enu(0, 0, 50)),
    lambda scenario: make_uav(clocked(scenario, "gps"), NodeId(1), "contract", position=Enu(0, 0, 50)),
    lambda scenario: Medium(scenario, "contract"),
    lambda scenario: WorldActor(scenario, "contract"),
]

anything = st.floats(allow_nan=True, allow_infinity=True)
vectors = st.builds(Enu, anything, anything, anything)
instants = st.integers(-(2**62), 2**62)
MEMBERS = (Member(2, 0, is_head=True), Member(3, 0, is_head=False))
HEADER = wire.Header(5, 1, 3, 0xFFFF, 3, 0, 32, 0, 3, 1).encode()
frames = st.one_of(
    st.binary(max_size=60),
    st.binary(max_size=60).map(lambda tail: HEADER + tail),
    st.builds(
        lambda seq, kind, flags, priority, tail: (
            wire.Header(5, seq, 3, 0xFFFF, 3, kind, 32, 0, priority, flags).encode() + tail
        ),
        st.integers(0, 50), st.integers(0, 4), st.integers(0, 3), st.integers(0, 3),
        st.one_of(
            st.binary(max_size=30),
            st.just(Join(3, Enu(1, 2, 3)).encode_frame(3)),
            st.builds(
                lambda t_ns, hello: TimeBeacon(t_ns, 5, 5, 5, hello, hello, 3, 1, 0, 1).encode_frame(3),
                st.integers(0, 2**62), st.integers(0, 50),
            ),
            st.just(Survivor(1, 1, 3, Enu(1, 2, 3), -60.0).encode_frame(3)),
            st.builds(
                lambda slot, period: Schedule(
                    0, max(slot, period), slot, 1, 1, 2, 0, 1, MEMBERS
                ).encode_frame(1),
                st.integers(1, 2**31), st.integers(1, 2**31),
            ),
        ),
    ),
)  # fmt: skip
labels = st.sampled_from(["", "a", "b", "x" * 40])
nodes = st.integers(0, 12).map(NodeId)
hostile: st.SearchStrategy[Message] = st.one_of(
    st.builds(Reception, frames, st.integers(0, 0xFFFF).map(NodeId), instants, anything),
    st.builds(TxStatus, st.integers(0, 99), st.sampled_from(TxOutcome), instants, st.integers(0, 255)),
    st.builds(
        TxRequest, st.integers(0, 2**32 - 1), instants, frames, st.integers(0, 0xFFFF).map(NodeId), st.booleans()
    ),
    st.builds(Setpoint, instants, vectors, anything),
    st.builds(WifiScan, instants, st.just(((1, -50.0),))),
    st.builds(
        lambda ids, states: Poses(0, array("H", ids), array("d", states)),
        st.lists(st.integers(0, 12), max_size=4), st.lists(anything, max_size=24),
    ),
    st.builds(MavlinkTap, instants, st.binary(max_size=9)),
    st.builds(Degrade, labels, nodes, nodes, st.booleans(), anything, anything, instants),
    st.builds(Jam, labels, vectors, anything, anything, instants),
    st.builds(Cut, labels, nodes, instants),
    st.builds(Restore, labels),
    st.builds(Gps, instants, st.just(Enu(1, 2, 3)), st.just(Enu(0, 0, 0))),
)  # fmt: skip
topics = st.sampled_from(
    [NAMES.radio_control, NAMES.radio_control, NAMES.radio_tx(1), NAMES.radio_tx(77),
     NAMES.radio_rx(1), NAMES.pose, NAMES.setpoint(2), NAMES.setpoint(99),
     NAMES.sensor(1, "gps"), "nonsense", ""]
)  # fmt: skip


@pytest.mark.parametrize("make", MAKERS, ids=["leader", "member", "beacons", "gps", "medium", "world"])
@examples(20, suppress_health_check=[HealthCheck.too_slow])
@given(script=st.lists(st.tuples(topics, hostile, st.integers(0, 300 * MS)), max_size=25))
def test_any_messages_on_any_topics_never_raise_and_the_actor_lives_on(
    make: Callable[[Scenario], Actor], script: list[tuple[str, Message, int]]
) -> None:
    actor = make(SCENARIO)
    now_ns = 0
    actor.start(now_ns)
    for topic, message, pause_ns in script:
        actor.receive(topic, message, now_ns)
        until_ns = now_ns + pause_ns
        turns = 0
        while (wake_ns := actor.next_wake_ns()) is not None and wake_ns <= until_ns:
            now_ns = max(now_ns, wake_ns)
            actor.wake(now_ns)
            turns += 1
            assert turns < 10_000, "an actor that lets no time pass"
        now_ns = until_ns
        actor.outbox.clear()
        actor.records.clear()
    actor.stop(now_ns)
    assert actor.report()["kind"] in ("agent", "emulator", "world")


# --- started in the middle of a run -----------------------------------------------------------------------------------

LATE_NS = 30 * S
RULES = [*({"routing.protocol": name} for name in PROTOCOLS), *({"clusters.relay": name} for name in RELAYS)]
ARRIVALS = ["cbr", "poisson", "saturated"]


def late_scenario(make_scenario: Callable[..., Scenario], **keys: object) -> Scenario:
    """Ten packets a second, due since second 5, when an actor is started at second 30."""
    return make_scenario(
        **{"nodes.count": 4, "nodes.telemetry_hz": 4, "duration_s": 60, "warmup_s": 5, "clusters.repair_s": 0,
           "traffic.sources": "all", "traffic.interval_s": 0.1, "mission.survivors": 1, **keys}
    )  # fmt: skip


def live(actor: Actor, *, until_ns: int) -> tuple[list[int], list[Generated]]:
    """Start an actor late; returns by how much each instant it asked for was past, and its packets."""
    now_ns, behind, packets = LATE_NS, [], []
    actor.start(now_ns)
    while (wake_ns := actor.next_wake_ns()) is not None and wake_ns <= until_ns:
        behind.append(max(0, now_ns - wake_ns))
        now_ns = max(now_ns, wake_ns)
        actor.wake(now_ns)
        packets += [record for record in actor.records if isinstance(record, Generated)]
        actor.outbox.clear()
        actor.records.clear()
        assert len(behind) < 10_000, "an actor that lets no time pass"
    return behind, packets


@pytest.mark.parametrize("arrivals", ARRIVALS)
@pytest.mark.parametrize("rule", RULES, ids=lambda rule: "-".join(rule.values()))
@pytest.mark.parametrize("node", [1, 2])
def test_a_uav_that_is_started_late_asks_for_nothing_past_and_sends_nothing_of_before(
    make_scenario: Callable[..., Scenario], rule: dict[str, str], node: int, arrivals: str
) -> None:
    scenario = late_scenario(make_scenario, **rule, **{"traffic.arrivals": arrivals})
    uav = Uav(scenario, NodeId(node), "contract", position=Enu(0, 0, 50))
    behind, packets = live(uav, until_ns=LATE_NS + S)
    assert max(behind) <= scenario.radio.lead_ns, "but a packet that is due within the lead is announced at once"
    assert min(packet.t_ns for packet in packets) >= LATE_NS
    most = 30 if arrivals != "saturated" else 50
    assert 3 <= len(packets) <= most, "not also the 250 that were due before"


@pytest.mark.parametrize("make", MAKERS, ids=["leader", "member", "beacons", "gps", "medium", "world"])
def test_an_actor_that_is_started_late_asks_for_nothing_past(
    make_scenario: Callable[..., Scenario], make: Callable[[Scenario], Actor]
) -> None:
    scenario = late_scenario(make_scenario, **{"world.engine": "kinematic"})
    behind, _ = live(make(scenario), until_ns=LATE_NS + S)
    assert max(behind, default=0) <= scenario.radio.lead_ns
