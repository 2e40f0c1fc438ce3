"""Valid bytes to begin with: what a few short runs of all protocols put on the air and on the bus.

    a run in virtual time -> every frame that a node hands to its radio, every message that an actor puts -> by kind

What no run says (faults on command, a clock) is made by hand.
"""

import json
from array import array
from collections import defaultdict
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from fanet_mw import wire
from fanet_mw.bus import codecs
from fanet_mw.bus.messages import (
    Altimeter,
    Battery,
    Call,
    Camera,
    CameraImage,
    ClockEpoch,
    ClockRequest,
    ClockState,
    Echo,
    FlightState,
    Inertial,
    LandingTarget,
    Message,
    Obstructions,
    Person,
    Radar,
    Report,
    Setpoint,
    SetpointKind,
    TraceBatch,
    TxRequest,
    Voice,
    WindEstimate,
)
from fanet_mw.bus.radio_control import Cut, Degrade, Jam, Mishap, MishapKind, Partition, Restore
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import MalformedFrameError
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.mavlink import Encoder
from fanet_mw.orders import Order, OrderKind
from fanet_mw.radios.udp import Datagram, DatagramKind
from fanet_mw.routing import rival_control_messages as control
from fanet_mw.trace import Record
from fanet_mw.units import BROADCAST, Enu, NodeId, S
from fanet_mw.wire.application_message import DELIVERED, MISSING, Head, Receipt, encode_piece, encode_receipts
from fanet_mw.wire.search_messages import Bid, Roll, ToldOrder, encode_bids
from fanet_mw.wire.search_plan import Search, SearchStatus
from fanet_mw.wire.survivors import Found, Standing
from sim.run.virtual import actors_of
from sim.scenarios import catalog

SETTINGS: Final[dict[str, tuple[str, ...]]] = {
    "rounds": ("routing.protocol=rounds",),
    "direct": ("routing.protocol=direct", "nodes.spacing_m=60"),
    "flooding": ("routing.protocol=flooding",),
    "gossip": ("routing.protocol=gossip",),
    "counter": ("routing.protocol=counter",),
    "aodv": ("routing.protocol=aodv", "traffic.destination=9"),
    "olsr": ("routing.protocol=olsr", "traffic.destination=9"),
    "dsdv": ("routing.protocol=dsdv", "traffic.destination=9"),
    "geographic": ("routing.protocol=geographic", "traffic.destination=9"),
    "all": ("clusters.relay=all", "mobility.model=crossing", "clusters.repair_s=5", "clusters.reassign_s=1"),
    "relay-counter": ("clusters.relay=counter", "clock.sync=beacons", "clock.offset_ms=5", "clock.drift_ppm=20"),
    "scheduled": ("clusters.relay=scheduled",),
    "measured": (
        "clusters.relay=scheduled",
        "clusters.links=measured",
        "clusters.repair_s=5",
        "clusters.load=heard",
    ),
}
"""Swarms of every routing protocol, and of `clustered` every way to relay, repair and keep time but one."""
SMALL: Final = (
    "nodes.count=9", "clusters.count=2", "nodes.spacing_m=120", "world.engine=kinematic", "mobility.model=static",
    "mission.survivors=3", "clusters.flooding_period_s=0.5", "traffic.interval_s=0.5", "traffic.payload_bytes=128",
    "radio.max_frame_bytes=1500", "warmup_s=1", "drain_s=0.5", "nodes.telemetry_hz=1",
)  # fmt: skip


def scenario_of(name: str, *more: str) -> Any:
    """One of these swarms."""
    return catalog.find("quick", [*SMALL, *SETTINGS[name], *more])


class Corpus(NamedTuple):
    """Valid inputs, by kind."""

    frames: Sequence[bytes]
    """Radio frames; first those of each message, so that a short look at them meets all."""
    control: Sequence[tuple[int, bytes]]
    """Types and bodies of the rivals' messages."""
    puts: Sequence[bytes]
    """One message of the bus each."""
    lines: Sequence[str]
    """Lines of a trace."""
    datagrams: Sequence[bytes]


def recorded(*, seconds: float = 10, swarms: Sequence[str] = tuple(SETTINGS)) -> Corpus:
    """What these swarms say in so many seconds; the same each time."""
    frames: dict[bytes, None] = {}
    puts: dict[type[Any], dict[bytes, None]] = defaultdict(dict)
    records: list[Record] = []
    for message in (message for name in swarms for message in _said(name, seconds, records)):
        if isinstance(message, TxRequest):
            frames[message.frame] = None
        kept = puts[type(message)]
        if len(kept) < 200:
            kept[codecs.encode([message])] = None
    header = wire.Header(12, 1, 3, BROADCAST, 3, wire.Kind.DATA, 8, 0, wire.PRIORITY_SAFETY, wire.FLAG_FLOOD).encode()
    warning = Encoder(NodeId(3), component=wire.COMPONENT).collision(
        NodeId(2), closest_s=3.0, altitude_m=2.0, horizontal_m=9.0
    )
    for inner in (warning, *_not_recorded()):
        frames[header + inner] = None
    for message in _BY_HAND:
        puts[type(message)][codecs.encode([message])] = None
    rare_first = sorted(frames, key=_commonness(list(frames)).__getitem__)
    return Corpus(
        frames=rare_first,
        control=[found for frame in rare_first if (found := _control_of(frame)) is not None],
        puts=[put for kind in puts.values() for put in kind],
        lines=lines_in(puts[TraceBatch]),
        datagrams=[
            *(Datagram(DatagramKind.FRAME, NodeId(1), BROADCAST, 7, frame).encode() for frame in rare_first[:20]),
            Datagram(DatagramKind.ACK, NodeId(2), NodeId(1), 7).encode(),
        ],
    )  # fmt: skip


def _said(name: str, seconds: float, records: list[Record]) -> list[Message]:
    found = scenario_of(name, f"duration_s={seconds}", "seed=3")
    names = Topics(found.name)
    said: list[Message] = []

    def hear(_: str, message: Message) -> None:
        said.append(message)

    everything = (
        names.all_tx, names.radio_rx("*"), names.radio_links, names.pose, names.obstruction, names.all_setpoints,
        names.all_sensors, names.mavlink("*"),
    )  # fmt: skip
    actors = actors_of(found, found.name)
    host = VirtualHost(actors, on_records=records.extend, listeners=[(topic, hear) for topic in everything])
    records.clear()
    host.start()
    host.run(found.duration_ns)
    host.stop()
    said += [TraceBatch(tuple(records[at : at + 5])) for at in range(0, len(records), 5)]
    said += [Report(actor.name, S, json.dumps(actor.report())) for actor in actors]
    return said


def _not_recorded() -> list[bytes]:
    """What these swarms do not send: plan, status, bids and finds of a search; pieces and receipts of messages."""
    head = Head(7, 3, 1, 300, 5000, 14, 2, 200, 0, 2, 1)
    text = Encoder(NodeId(3), component=wire.COMPONENT).collision(
        NodeId(2), closest_s=3.0, altitude_m=2.0, horizontal_m=9.0
    )
    covariance = {"east_variance_m2": 90.0, "covariance_m2": 3.0, "north_variance_m2": 40.0}
    return [
        Search(7, 100.0, 0.0, 400.0, 50.0, 10.0, 30, 1, 1, (1, 2, 3, 4, 5, 0, 7), 3, 1, 0).encode_frame(1),
        Search(7, 500.0, 50.0, 450.0, 50.0, 10.0, 30, 1, 1, (1, 2, 3, 4, 5, 0), 5, 0, 1, 1, 1).encode_frame(1),
        Search(7, 500.0, 10.0, 480.0, 50.0, 10.0, 30, 1, 1, (1, 2, 3, 4, 5, 0, 7), 1, 0, 3, 2, 4).encode_frame(1),
        SearchStatus(7, Enu(1.0, 2.0, 3.0), 4, 1, 80).encode_frame(4),
        encode_bids([Bid(3, 4, 200, 7), Bid(5, 6, 0xFFFF, 8, 2)], node=4),
        Found(7, 3, 10.0, 20.0, node=4, standing=Standing.ESTIMATED, **covariance).encode_frame(4),
        Roll(77, 3, 2, (0, 5, 127, 60), frozenset((1, 2))).encode_frame(4),
        ToldOrder(7, 9, 1, Order(OrderKind.SEARCH, 3, 10.0, 20.0, 50.0)).encode_frame(9),
        encode_piece(head, bytes(range(200)), node=3),
        encode_piece(head._replace(piece=1), bytes(100), node=3, targets=range(1, 40)),
        encode_piece(head._replace(size=len(text), port=0, pieces=1, stride=1000), text, node=3, targets=(4,)),
        encode_receipts([Receipt(3, 9, DELIVERED), Receipt(1, 8, MISSING)], node=4),
    ]


_BY_HAND: Final[tuple[Message, ...]] = (
    ClockEpoch(1_735_689_600 * S, 1.0, ClockState.RUNNING, 5 * S, 77),
    Obstructions(S, array("H", [1, 2, 3, 4])),
    Obstructions(S, array("H", [1, 2, 3, 4]), array("H", [60, 352])),
    Obstructions(S, array("H", [1, 2]), array("H", [60]), array("f", [0.0, 41.5])),
    Degrade("link", NodeId(1), NodeId(2), both=True, loss_db=10.0, loss_share=0.5, for_ns=S),
    Jam("jam", Enu(1.0, 2.0, 3.0), 100.0, -60.0, for_ns=S),
    Cut("cut", NodeId(3), for_ns=S, sends=True),
    Partition("part", (NodeId(3), NodeId(4)), (1.0, 2.0, 3.0, 4.0), for_ns=S),
    Mishap("mishap", NodeId(3), MishapKind.GPS, Enu(1.0, 2.0, 3.0), for_ns=S),
    Restore("cut"),
    Order(OrderKind.SEARCH, 3, 10.0, 20.0, 50.0),
    ClockRequest(0.5),
    Setpoint(S, Enu(1.0, 2.0, 3.0), 5.0),
    Setpoint(S, Enu(1.0, 2.0, 3.0), 5.0, SetpointKind.VELOCITY, Enu(1.0, 0.0, -1.0)),
    Camera(S, (Person(1.0, -0.5, 30.0), Person(2.0, -0.4, 40.0))),
    CameraImage(S, 2, 1, bytes(6)),
    Voice(S, (Call(1.0, -0.5, 30.0, 6.0),)),
    Radar(S, (Echo(100.0, 1.0, -0.5, 3.0, 20.0), Echo(200.0, 2.0, 0.1, -1.0, 10.0))),
    Altimeter(S, 50.0, None),
    Altimeter(S, 50.0, 49.0),
    Inertial(S, Enu(1.0, 2.0, 3.0)),
    Battery(S, 15.0, 20.0, 0.5),
    WindEstimate(S, Enu(3.0, -1.0, 0.1)),
    LandingTarget(S, Enu(0.5, -1.0, -20.0)),
    FlightState(S, 0.1, -0.2, 3.0, 14, 0.8, 1_800_000_000 * S),
)


def _messages_in(frame: bytes) -> tuple[int, ...]:
    return tuple(int.from_bytes(inner[7:10], "little") for inner in wire.frames(frame))


def _commonness(frames: Sequence[bytes]) -> dict[bytes, int]:
    """How many frames of the same messages come before each."""
    seen: dict[tuple[int, ...], int] = defaultdict(int)
    rank = {}
    for frame in frames:
        kinds = _messages_in(frame)
        rank[frame] = seen[kinds]
        seen[kinds] += 1
    return rank


def kind_of(frame: bytes) -> int:
    """What kind of packet a valid frame is."""
    return wire.decode_header(frame).kind


def _control_of(frame: bytes) -> tuple[int, bytes] | None:
    try:
        return control.decode(frame)
    except MalformedFrameError:
        return None


def lines_in(batches: Sequence[bytes] | dict[bytes, None]) -> list[str]:
    """The lines in some puts of trace records."""
    return [line for put in batches for line in put[5:].decode().splitlines()]
