"""What a message costs beside a packet of load: `python tests/benchmarks/message_cost.py`. Virtual time, two nodes.

One node sends the same data over and over to the other, over a link that loses nothing; hellos and telemetry are off.

    packets   frames that both radios send for one message, receipts included
    bytes     of these frames on the air, with MAC, IP and UDP headers
    overhead  these bytes over the data that was sent
    CPU       process time of both UAVs for one message, from `port.send` to `on_message`; of this machine
"""

import sys
from collections.abc import Sequence
from time import process_time_ns
from typing import Final, NamedTuple

from agents.uav import Uav
from fanet_mw import wire
from fanet_mw.actor import Actor
from fanet_mw.airtime import OVERHEAD_BYTES
from fanet_mw.application import Application, Data, Received
from fanet_mw.bus.messages import Message, Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.bus.topics import Topics, node_of
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.scenario import config
from fanet_mw.units import MS, Enu, NodeId
from fanet_mw.wire.application_message import room_for_data

NAMES: Final = Topics("cost")
SOURCE, TARGET = NodeId(1), NodeId(2)
PORT: Final = 5
INTERVAL_NS: Final = 250 * MS
"""Longer than a receipt waits for others: each message has its own."""
LOAD_BYTES: Final = 1024
"""A packet of the shipped scenarios' load, as UDP payload."""
DATA_BYTES: Final = room_for_data(LOAD_BYTES - wire.HEADER_BYTES)
"""The data in such a packet."""
FILLER: Final = wire.filler(LOAD_BYTES - wire.HEADER_BYTES, node=SOURCE)


class Case(NamedTuple):
    """One way to bring data to another node."""

    name: str
    content: bytes | Data
    size: int
    """Bytes of data."""
    confirm: bool = False


CASES: Final = (
    Case("load: a packet whose content does not matter", FILLER, DATA_BYTES),
    Case("bytes to a port, let out and no more", Data(PORT, bytes(DATA_BYTES)), DATA_BYTES),
    Case("the same, confirmed", Data(PORT, bytes(DATA_BYTES)), DATA_BYTES, confirm=True),
    Case("100 bytes, confirmed", Data(PORT, bytes(100)), 100, confirm=True),
    Case("10,000 bytes, confirmed", Data(PORT, bytes(10_000)), 10_000, confirm=True),
)  # fmt: skip


class Air(Actor):
    """Every frame reaches the other node at once."""

    def __init__(self) -> None:
        super().__init__("air", tuple(NAMES.radio_tx(node) for node in (SOURCE, TARGET)))
        self.frames = self.bytes = 0

    def start(self, now_ns: int) -> None:
        pass

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        assert isinstance(message, TxRequest), "nothing else is asked of a radio"
        node = node_of(topic)
        self.frames += 1
        self.bytes += len(message.frame) + OVERHEAD_BYTES
        reception = Reception(message.frame, NodeId(node), now_ns, -50.0)
        self.outbox.append((NAMES.radio_rx(NodeId(SOURCE + TARGET - node)), reception))
        if message.wants_status:
            self.outbox.append((NAMES.radio_rx(NodeId(node)), TxStatus(message.seq, TxOutcome.ACKED, now_ns, 1)))

    def wake(self, now_ns: int) -> None:
        raise AssertionError("it asks for no wake-up")

    def next_wake_ns(self) -> int | None:
        return None


class Source(Application):
    """Sends the same so many times."""

    name = "source"

    def __init__(self, case: Case, count: int) -> None:
        self._case, self._left, self._due_ns = case, count, INTERVAL_NS

    def next_wake_ns(self) -> int | None:
        return self._due_ns if self._left else None

    def wake(self, now_ns: int) -> None:
        self._left -= 1
        self._due_ns += INTERVAL_NS
        self.port.send(self._case.content, destination=TARGET, confirm=self._case.confirm)


class Sink(Application):
    """Counts what comes."""

    name = "sink"
    ports = (PORT,)

    def __init__(self) -> None:
        self.got = 0

    def on_message(self, message: Received, now_ns: int) -> None:
        self.got += 1


class Cost(NamedTuple):
    """What a number of messages have cost."""

    frames: int
    bytes: int
    cpu_ns: int


def cost(case: Case, count: int) -> Cost:
    """Send so many messages and see each arrive."""
    settings = {
        "name": "cost", "duration_s": 3600, "nodes": {"count": 2, "telemetry_hz": 0}, "clusters": {"count": 1},
        "traffic": {"arrivals": "none"}, "routing": {"protocol": "direct", "hello_interval_s": 0},
    }  # fmt: skip
    scenario = config.build(settings)
    air, sink = Air(), Sink()
    place = Enu(0.0, 0.0, 50.0)
    uavs = [
        Uav(scenario, SOURCE, "cost", position=place, applications=[Source(case, count)]),
        Uav(scenario, TARGET, "cost", position=place, applications=[sink]),
    ]
    host = VirtualHost([air, *uavs])
    host.start()
    began_ns = process_time_ns()
    host.run((count + 8) * INTERVAL_NS)
    spent_ns = process_time_ns() - began_ns
    assert isinstance(case.content, bytes) or sink.got == count, "every message has arrived, and once"
    return Cost(air.frames, air.bytes, spent_ns)


def rows(count: int) -> list[list[str]]:
    """A head, and a row for each way."""
    found = [["what is sent", "data [B]", "packets", "bytes on the air", "overhead", "CPU [us]"]]
    for case in CASES:
        spent = min((cost(case, count) for _ in range(3)), key=lambda cost: cost.cpu_ns)
        on_air = spent.bytes / count
        found.append([
            case.name, f"{case.size}", f"{spent.frames / count:.1f}", f"{on_air:.0f}", f"{on_air / case.size:.2f}",
            f"{spent.cpu_ns / count / 1000:.0f}",
        ])  # fmt: skip
    return found


def main(arguments: Sequence[str]) -> None:
    for row in rows(int(arguments[0]) if arguments else 1000):
        print("| " + " | ".join(row) + " |")


if __name__ == "__main__":
    main(sys.argv[1:])
