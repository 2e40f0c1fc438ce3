"""Whatever comes from a ground station, a UAV counts it or answers it, and never ends."""

import math
import random
import struct
from collections import Counter
from collections.abc import Collection

import pytest
from operator_bench import Bench, scenario

from agents.ground.operator_relay import MOST_PER_S, OperatorRelay
from fanet_mw.gateway.framing import layout, with_crc
from fanet_mw.mavlink import common
from fanet_mw.rng import stream
from fanet_mw.units import BROADCAST, Enu, NodeId, S
from fanet_mw.wire import frames

KNOWN = sorted(common.mavlink_map)
ASKED = [
    "COMMAND_LONG", "COMMAND_INT", "SET_MODE", "MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ITEM",
    "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_CLEAR_ALL", "MISSION_ACK",
    "MISSION_SET_CURRENT", "SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "REQUEST_DATA_STREAM",
    "PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET", "FILE_TRANSFER_PROTOCOL", "PING", "TIMESYNC",
    "LOG_REQUEST_LIST",
]  # fmt: skip
UNDERSTOOD = [number for number in KNOWN if common.mavlink_map[number].msgname in ASKED]
COMMANDS = [16, 17, 19, 20, 21, 22, 93, 112, 115, 176, 177, 178, 192, 193, 224, 300, 400, 510, 511, 512, 520, 5001]


def hostile(random_: random.Random) -> bytes:
    """A whole frame of a known message, mostly for this UAV, with fields that nobody would send."""
    number = random_.choice(UNDERSTOOD if random_.random() < 0.9 else KNOWN)
    shape = layout(number)
    assert shape is not None
    payload = bytearray(random_.randbytes(common.mavlink_map[number].unpacker.size))
    if random_.random() < 0.5:  # floats that are odd, and fields that make sense
        odd = random_.choice([math.nan, math.inf, -math.inf, 0.0, 1.0, -1.0, 1e30, 20.0])
        for at in range(0, len(payload) - 3, 4):
            struct.pack_into("<f", payload, at, odd if random_.random() < 0.5 else random_.uniform(-200, 200))
    if number in (75, 76):
        struct.pack_into("<H", payload, 28, random_.choice(COMMANDS))
    if number in (73, 39):
        struct.pack_into("<HH", payload, 28, random_.randrange(4), random_.choice(COMMANDS))
        payload[-1] = random_.randrange(3)
    if number == 44:
        struct.pack_into("<H", payload, 0, random_.randrange(6))
    if shape.target_at is not None and random_.random() < 0.95:
        payload[shape.target_at] = 1
        payload[shape.target_at + 1 : shape.target_at + 2] = b"\x01"
    head = bytes((0xFD, len(payload), 0, 0, 0, 255, 190)) + number.to_bytes(3, "little")
    return with_crc(head + bytes(payload), shape.crc_extra)


@pytest.mark.parametrize(
    ("number", "count"),
    [(1, 4000), (2, 4000), pytest.param(3, 1_000_000, marks=[pytest.mark.slow, pytest.mark.timeout(1800)])],
)
def test_a_hostile_ground_station_ends_no_uav(number: int, count: int) -> None:
    random_ = stream(1, "hostile", number)
    bench = Bench() if number % 2 else Bench(scenario(nodes={"count": 2, "on_ground": False}), at=Enu(0.0, 0.0, 50.0))
    for step in range(count):
        bench.control.on_operator(hostile(random_), bench.now_ns)
        bench.now_ns += S // 150
        if step % 20 == 0:
            bench.run(0.2, heartbeats=False)
            bench.streams.telemetry(bench.now_ns)
        for course in bench.courses[-2:]:
            assert course.position.is_within(1e4)
            assert math.isfinite(course.speed_m_s)
        bench.heard.clear()
    assert bench.control.report()["operator_understood"] > count * 0.6


class AirPort:
    """Keeps what goes on the air, and to whom."""

    def __init__(self) -> None:
        self.sent: Counter[tuple[object, int]] = Counter()

    def send(self, content: bytes, *, destination: NodeId | Collection[NodeId], priority: int) -> None:
        assert frames(content), "whole frames"
        self.sent[destination, priority] += 1


@pytest.mark.parametrize("count", [4000, pytest.param(1_000_000, marks=[pytest.mark.slow, pytest.mark.timeout(900)])])
def test_a_hostile_ground_station_at_the_post_puts_whole_frames_for_uavs_on_the_air_and_no_more_than_may_be(
    count: int,
) -> None:
    """Its frames come through the gateway, which has checked that each is whole (`test_routing.py`)."""
    random_ = stream(1, "hostile", 4)
    chosen = scenario(ground={"at_m": [0.0, 0.0]})
    relay, air, now_ns = OperatorRelay(chosen), AirPort(), 0
    relay.port = air  # type: ignore[assignment]
    for _ in range(count):
        now_ns += S // 1000
        said = b"".join(hostile(random_) for _ in range(random_.choice((1, 1, 1, 2, 5))))
        relay.on_operator(said, now_ns)
    report = relay.report()
    assert {to for to, _ in air.sent} <= {1, 2, BROADCAST}
    assert sum(air.sent.values()) == report["operator_sent"] <= (now_ns // S + 1) * MOST_PER_S
    assert report["operator_too_many"] > count * 0.5
    assert report["operator_for_nobody_here"] > 0
