"""A foreign station repeats, byte for byte and later, the hellos that it heard: nobody's clock follows it."""

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

import pytest

from fanet_mw import wire
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, Reception, TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.node.reader import packet_of
from fanet_mw.trace import ClockSampled, Delivered, Generated, Record
from fanet_mw.units import BROADCAST, MS, US, NodeId, S
from fanet_mw.wire import Kind
from sim.run.virtual import actors_of
from sim.scenarios import catalog

STATION = NodeId(8)
FAIR = [node for node in range(1, 16) if node != STATION]
KEYS = (
    "nodes.count=15", "clusters.count=14", "clusters.turn_slack_us=400", "duration_s=34", "warmup_s=26",
    "clock.sync=beacons", "clock.offset_ms=5", "clock.drift_ppm=20", f"traffic.targets={FAIR}",
    f"traffic.sources={FAIR[1:]}",
)  # fmt: skip


class Repeater(Actor):
    """Hears everything at the place of one node, and repeats each hello later."""

    def __init__(self, swarm: str, delay_ns: int) -> None:
        topics = Topics(swarm)
        super().__init__(f"agent-{STATION}", (topics.radio_rx(STATION),))
        self._topic, self._delay_ns, self._sent = topics.radio_tx(STATION), delay_ns, 0
        self._waiting: list[tuple[int, bytes]] = []

    def start(self, now_ns: int) -> None:
        """Nothing is prepared."""

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        if isinstance(message, Reception) and wire.peek_kind(message.frame) == Kind.HELLO:
            self._waiting.append((message.end_ns + self._delay_ns, message.frame))

    def next_wake_ns(self) -> int | None:
        return self._waiting[0][0] if self._waiting else None

    def wake(self, now_ns: int) -> None:
        while self._waiting and self._waiting[0][0] <= now_ns:
            request = TxRequest(self._sent, now_ns, self._waiting.pop(0)[1], BROADCAST, wants_status=False)
            self.outbox.append((self._topic, request))
            self._sent += 1

    def report(self) -> Mapping[str, Any]:
        return {}


def run(delay_ns: int, *, spoofed: bool, seed: int) -> tuple[list[Record], list[Mapping[str, Any]]]:
    scenario = catalog.find("clusters", [*KEYS, f"seed={seed}"])
    repeater = Repeater(scenario.name, delay_ns)
    actors = [repeater if actor.name == repeater.name else actor for actor in actors_of(scenario, scenario.name)]
    for actor in actors:
        if spoofed and actor.name.startswith("agent-") and actor is not repeater:
            actor.receive = heard_from_its_transmitter(actor)  # type: ignore[method-assign]
    records: list[Record] = []
    host = VirtualHost(actors, on_records=records.extend)
    host.start()
    host.run(scenario.duration_ns)
    return records, [actor.report() for actor in actors if actor.name.startswith("agent-") and actor is not repeater]


def heard_from_its_transmitter(actor: Actor) -> Any:
    """The station also forges the address of its radio: it transmits under that of whom it repeats."""
    receive = actor.receive

    def received(topic: str, message: Message, now_ns: int) -> None:
        if isinstance(message, Reception) and message.src == STATION:
            message = message._replace(src=NodeId(packet_of(message.frame).header.prev_hop))
        receive(topic, message, now_ns)

    return received


@pytest.mark.parametrize(
    ("delay_ns", "spoofed", "seed"),
    [(200 * MS, False, 1), (200 * MS, True, 1), (200 * MS, True, 2), (3 * S, False, 1), (3 * S, True, 1)],
)
def test_clocks_and_deliveries_are_those_without_the_station(delay_ns: int, spoofed: bool, seed: int) -> None:
    records, reports = run(delay_ns, spoofed=spoofed, seed=seed)
    ahead: dict[int, list[int]] = defaultdict(list)
    for record in records:
        if isinstance(record, ClockSampled) and record.node in FAIR and record.t_ns >= 26 * S:
            ahead[record.t_ns].append(record.ahead_ns)
    assert max(max(values) - min(values) for values in ahead.values()) < 100 * US
    generated = sum(isinstance(record, Generated) for record in records)
    delivered = len({(r.node, r.origin, r.seq) for r in records if isinstance(r, Delivered) and r.node in FAIR})
    assert delivered / (generated * (len(FAIR) - 1)) > 0.97  # some were sent a moment before the end
    refused = "old" if spoofed else "relayed"
    assert sum(report["clock"].get(refused, 0) for report in reports) > 50
