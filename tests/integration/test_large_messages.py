"""Messages of many packets in a small swarm: whatever relays, they reach everyone; what is too long is refused."""

from collections.abc import Sequence

import pytest
from kit import slow

from fanet_mw import wire
from fanet_mw.application import Application, Data, Fate, Received, Status
from fanet_mw.errors import DropReason, LocalProtocolError
from fanet_mw.trace import Delivered, Dropped, Generated
from fanet_mw.units import NodeId, S
from sim.run.virtual import simulate
from sim.scenarios import catalog

SMALL = [
    "duration_s=50", "warmup_s=9", "drain_s=5", "traffic.arrivals=none", "world.engine=kinematic",
    "mission.survivors=0",
]  # fmt: skip
SOURCE = NodeId(2)
SIZES = (300, 3000, 20_000)
CASES = [(size, confirm) for size in SIZES for confirm in (False, True)]


def content(case: int) -> bytes:
    size, _ = CASES[case]
    return (bytes(range(256)) * (size // 256 + 1))[case : case + size]


class Courier(Application):
    """At node 2: sends each message of CASES to all, 6 s after the one before, on a port of its own."""

    name = "courier"
    ports = tuple(range(1, 1 + len(CASES)))
    follows = (Fate.ACKNOWLEDGED, Fate.EXPIRED, Fate.DROPPED)

    def __init__(self, node: NodeId) -> None:
        self.node = node
        self.got: list[int] = []
        self.acknowledged: dict[int, int] = {}
        self.lost: list[Status] = []
        self._handles: dict[int, int] = {}
        self._case = 0
        self._due_ns = 9 * S if node == SOURCE else None

    def next_wake_ns(self) -> int | None:
        return self._due_ns

    def wake(self, now_ns: int) -> None:
        data = Data(1 + self._case, content(self._case))
        self._handles[self.port.send(data, confirm=CASES[self._case][1], lifetime_ns=60 * S)] = self._case
        self._case += 1
        self._due_ns = now_ns + 6 * S if self._case < len(CASES) else None

    def on_message(self, message: Received, now_ns: int) -> None:
        assert message.port is not None
        assert message.data == content(message.port - 1)
        self.got.append(message.port - 1)

    def on_status(self, status: Status, now_ns: int) -> None:
        case = self._handles[status.handle]
        if status.fate is Fate.ACKNOWLEDGED:
            self.acknowledged[case] = self.acknowledged.get(case, 0) + len(status.nodes)
        else:
            self.lost.append(status)


@pytest.mark.parametrize("relay", [*slow("all", "counter"), "scheduled"])
def test_whatever_relays_messages_of_all_lengths_reach_everyone(relay: str) -> None:
    couriers: dict[int, Courier] = {}

    def applications(node: int) -> Sequence[Application]:
        couriers[node] = Courier(NodeId(node))
        return [couriers[node]]

    keys = [f"clusters.relay={relay}", "traffic.payload_bytes=1024", "clusters.repair_s=8"]
    scenario = catalog.find("quick", [*SMALL, *keys])
    outcome = simulate(scenario, applications=applications)
    everything = list(range(len(CASES)))
    assert {node: sorted(courier.got) for node, courier in couriers.items() if node != SOURCE} == {
        node: everything for node in scenario.node_ids if node != SOURCE
    }
    source = couriers[SOURCE]
    assert source.lost == []
    assert source.acknowledged == {case: 8 for case in everything if CASES[case][1]}
    reasons = {record.reason for record in outcome.records if isinstance(record, Dropped)}
    assert DropReason.TOO_LARGE not in reasons


class Boundary(Application):
    """At node 2: sends a packet of the greatest length at each priority; then one byte more is refused."""

    name = "boundary"

    def __init__(self, node: NodeId) -> None:
        self.refused: list[str] = []
        self._due_ns = 14 * S if node == SOURCE else None

    def next_wake_ns(self) -> int | None:
        return self._due_ns

    def wake(self, now_ns: int) -> None:
        self._due_ns = None
        for priority in wire.PRIORITIES:
            with pytest.raises(LocalProtocolError) as error:
                self.port.send(wire.filler(3000), priority=priority)
            most = int(str(error.value).split("<= ")[1].split(":")[0])
            with pytest.raises(LocalProtocolError):
                self.port.send(wire.filler(most + 1), priority=priority)
            self.port.send(wire.filler(most), priority=priority)


WITH_REPORTS = ["mission.survivors=1", "mission.report_bytes=900", "traffic.payload_bytes=256"]


@pytest.mark.parametrize(
    "settings",
    [
        ["clusters.relay=scheduled", *WITH_REPORTS],
        ["clusters.relay=all"],
        *slow(
            ["clusters.relay=scheduled"],
            ["clusters.relay=scheduled", "routing.aggregate=true"],
            ["clusters.relay=scheduled", "clusters.links=measured"],
        ),
    ],
    ids=" ".join,
)
def test_a_packet_of_the_greatest_length_is_carried_at_each_priority(settings: list[str]) -> None:
    scenario = catalog.find("quick", [*SMALL, "duration_s=22", *settings])
    outcome = simulate(scenario, applications=lambda node: [Boundary(NodeId(node))])
    made = {r.seq: r.payload_bytes for r in outcome.records if isinstance(r, Generated) and r.app == "boundary"}
    assert len(made) == len(wire.PRIORITIES)
    assert max(made.values()) >= max(scenario.mission.report_bytes, scenario.traffic.payload_bytes)
    for seq in made:
        heard = {r.node for r in outcome.records if isinstance(r, Delivered) and (r.origin, r.seq) == (SOURCE, seq)}
        assert len(heard) == 8, (made[seq], "bytes")
    reasons = {record.reason for record in outcome.records if isinstance(record, Dropped)}
    assert DropReason.TOO_LARGE not in reasons
