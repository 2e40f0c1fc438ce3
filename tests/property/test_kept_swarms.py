"""What nodes say while others are lost, cut off, moved and started anew is kept: two releases may be in one swarm."""

import random
import zlib
from typing import Any

import pytest
from graph_radio import Swarm
from kept_values import kept

from fanet_mw import wire
from fanet_mw.bus.messages import TxRequest
from fanet_mw.node.node import Node
from fanet_mw.scenario import config
from fanet_mw.units import BROADCAST, Enu, NodeId, S

NODES = 9
SCHEDULED = {"routing.protocol": "clustered", "clusters.relay": "scheduled", "clusters.count": 8}
PROTOCOLS: dict[str, dict[str, Any]] = {
    **{name: {"routing.protocol": name} for name in ("aodv", "olsr", "dsdv", "geographic", "gossip", "counter")},
    "heads": {"routing.protocol": "clustered", "clusters.count": 3, "clusters.reassign_s": 3, "clusters.repair_s": 5},
    "all": {"routing.protocol": "clustered", "clusters.count": 2, "clusters.relay": "all", "routing.aggregate": True},
    "timetable": SCHEDULED | {"clusters.reassign_s": 4, "clusters.repair_s": 5},
    "loads": SCHEDULED | {"clusters.load": "heard", "traffic.sources": 8},
    "rounds": {"routing.protocol": "rounds", "rounds.bulk_share": 0.4, "rounds.turn_bytes": 500},
}


class Recorded(Swarm):
    """Notes what is on the air, and what nodes record and deliver."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.said: list[tuple[Any, ...]] = []

    def _transmit(self, name: NodeId, node: Node, request: TxRequest) -> None:
        self.said.append((self.now_ns, name, request.dst, zlib.crc32(request.frame)))
        super()._transmit(name, node, request)

    def _drain(self, name: NodeId) -> None:
        node = self.nodes[name]
        self.said += [(type(record).__name__, *record) for record in node.records]
        self.said += [(delivery.header.origin, delivery.header.seq) for delivery in node.deliveries]
        super()._drain(name)


def send(swarm: Swarm, node: int, to: int, priority: int) -> None:
    if node in swarm.nodes:
        swarm.nodes[NodeId(node)].send(
            wire.filler(60 + node, node=node), destination=NodeId(to), priority=priority, app="traffic",
            born_ns=swarm.now_ns, now_ns=swarm.now_ns,
        )  # fmt: skip
        swarm._drain(NodeId(node))


@pytest.mark.parametrize("name", PROTOCOLS)
def test_what_is_said_in_a_storm_is_what_it_was_before(name: str) -> None:
    tree: dict[str, dict[str, Any]] = {
        "nodes": {"count": NODES, "telemetry_hz": 0}, "clusters": {"flooding_period_s": 0.5, "count": 2},
        "radio": {"lead_ms": 0, "range_m": 310}, "traffic": {"payload_bytes": 200, "interval_s": 1.0},
    }  # fmt: skip
    for key, value in PROTOCOLS[name].items():
        table, _, last = key.partition(".")
        tree.setdefault(table, {})[last] = value
    swarm = Recorded(config.build(tree), [Enu(180.0 * (n % 3), 180.0 * (n // 3), 50.0) for n in range(NODES)])
    drawn = random.Random(name)
    for node in range(1, NODES + 1):
        swarm.start(node)
    swarm.advance(8 * S)
    for second in range(30):
        for _ in range(drawn.randrange(4)):
            to = drawn.choice((BROADCAST, BROADCAST, drawn.randrange(1, NODES + 1)))
            send(swarm, drawn.randrange(1, NODES + 1), to, drawn.randrange(4))
        swarm.loss = 0.3 if 8 <= second < 12 else 0.05
        match second:
            case 3 | 16:
                swarm.kill(5 if second == 3 else 1)
            case 11 | 26:
                swarm.start(5 if second == 11 else 1)
            case 14:
                swarm.walls |= {frozenset((NodeId(a), NodeId(b))) for a in (1, 2, 3) for b in range(4, 10)}
            case 21:
                swarm.walls.clear()
            case 23:
                swarm.move(9, Enu(540.0, 360.0, 50.0))
        swarm.advance(S)
    reports = [swarm.nodes[node]._protocol.report() for node in sorted(swarm.nodes)]
    kept(f"swarms, {name}", [len(swarm.said), sorted(swarm.delivered.items()), reports, *swarm.said])
