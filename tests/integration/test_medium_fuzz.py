"""The medium as a service under hostile input: inbox, codec and actor as the real-time host runs them, without a bus.

Every put is one sample, every message of it one count of the medium's; nothing raises and nothing is lost between.
"""

import random
from array import array
from collections.abc import Iterator
from itertools import islice

import pytest

from emulator.medium import Medium
from fanet_mw.bus import codecs
from fanet_mw.bus.messages import (
    ClockEpoch,
    ClockState,
    MavlinkTap,
    Message,
    Poses,
    Reception,
    TraceBatch,
    TxOutcome,
    TxRequest,
    TxStatus,
)
from fanet_mw.bus.radio_control import Control, Cut, Degrade, Jam, Mishap, MishapKind, Partition, Restore
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.inbox import Inbox
from fanet_mw.trace import ProcessEnded
from fanet_mw.units import BROADCAST, MS, Enu, NodeId
from sim.scenarios import catalog

NAMES = Topics("fuzz")
SCENARIO = catalog.find("quick", ["nodes.count=9", "radio.queue_frames=50"])
STRANGE_TOPICS = [
    NAMES.radio_tx(0), NAMES.radio_tx(10), NAMES.radio_tx(65535), NAMES.radio_tx("01"), NAMES.radio_tx("9" * 5000),
    NAMES.radio_tx("²"), NAMES.radio_tx("-1"), NAMES.radio_rx(1), NAMES.pose, NAMES.clock, "fanet/other/radio/1/tx",
    "fanet", "", "////", "\x00",
]  # fmt: skip
DEEP = bytes([9]) + (200_000).to_bytes(4, "little") + b"[" * 200_000
"""A trace record of nested lists: deeper than a parser may go."""


class Fuzz:
    """An endless row of puts from one seed, most of them nearly right."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._seq = [0] * 10
        self.now_ns = 0

    def puts(self) -> Iterator[tuple[str, bytes]]:
        rng = self._random
        while True:
            self.now_ns += rng.randrange(4 * MS)
            node = rng.randrange(1, 10)
            dice = rng.random()
            if dice < 0.05:
                data = codecs.encode([self._control()])
                yield NAMES.radio_control, data if dice < 0.03 else self._mutated(data)
            else:
                yield NAMES.radio_tx(node) if dice < 0.9 else rng.choice(STRANGE_TOPICS), self._payload(node)

    def _payload(self, node: int) -> bytes:
        rng = self._random
        dice = rng.random()
        if dice < 0.05:
            return rng.randbytes(rng.randrange(60))
        if dice < 0.051:
            return DEEP
        batch: list[Message] = [self._request(node) for _ in range(1 if dice < 0.8 else rng.randrange(4))]
        if dice > 0.9:
            batch.append(self._other())
        data = codecs.encode(batch)
        return data if dice < 0.5 or not data else self._mutated(data)

    def _request(self, node: int) -> TxRequest:
        rng = self._random
        self._seq[node] += 1 if rng.random() < 0.95 else rng.randrange(-3, 40_000)
        near = rng.random() < 0.9
        start_ns = self.now_ns + rng.randrange(-80 * MS, 80 * MS) if near else rng.randrange(-(2**63), 2**63)
        size = rng.choice((0, 1, 40, 200, 1024, 2304, 2305, 9000)) if rng.random() < 0.3 else 60
        dst = BROADCAST if rng.random() < 0.5 else NodeId(rng.randrange(12) if rng.random() < 0.8 else 0xFFFE)
        return TxRequest(self._seq[node] & 0xFFFF_FFFF, start_ns, bytes(size), dst, wants_status=rng.random() < 0.5)

    def _other(self) -> Message:
        rng = self._random
        kind = rng.randrange(6)
        if kind == 0:
            return Reception(b"frame", NodeId(1), self.now_ns, -50.0)
        if kind == 1:
            return TxStatus(1, TxOutcome.SENT, self.now_ns, 1)
        if kind == 2:
            return MavlinkTap(0, b"tap")
        if kind == 3:
            return TraceBatch((ProcessEnded(1, 2, "x", 3),))
        if kind == 4:
            return ClockEpoch(0, 1.0, ClockState.STOPPED)
        scale = rng.choice((0.0, 100.0, 300.0, 1e6, 1e7, 1e9, 1e300, float("inf"), float("nan")))
        ids = array("H", [rng.randrange(0, 12) if rng.random() < 0.02 else i for i in range(1, 10)])
        return Poses(self.now_ns, ids, array("d", [scale * rng.uniform(-1, 1) for _ in range(54)]))

    def _control(self) -> Control:
        rng = self._random
        label, for_ns = rng.choice(("a", "b", "c", "", "x" * 99)), rng.choice((0, 50 * MS, 50 * MS, -1, 2**62))
        a, b = NodeId(rng.randrange(11)), NodeId(rng.randrange(11))
        share, size = rng.choice((0.0, 0.5, 1.0, 1e300, float("nan"))), rng.choice((0.0, 3.0, 200.0, float("inf")))
        kinds: list[Control] = [
            Degrade(label, a, b, rng.random() < 0.5, size, share, for_ns),
            Jam(label, Enu(0.0, 0.0, share), rng.choice((200.0, size)), rng.choice((-90.0, size)), for_ns),
            Cut(label, a, for_ns, sends=rng.random() < 0.3, hears=rng.random() < 0.3),
            Partition(label, rng.choice(((), (a, b))), (size, share, 0.0, size), for_ns),
            Mishap(label, a, rng.choice(list(MishapKind)), Enu(share, size, 0.0), for_ns),
            Restore(label),
        ]
        return rng.choice(kinds)

    def _mutated(self, data: bytes) -> bytes:
        rng, changed = self._random, bytearray(data)
        dice = rng.randrange(4)
        if dice == 0:
            return bytes(changed[: rng.randrange(len(changed))])
        if dice == 1:
            return bytes(changed) + rng.randbytes(rng.randrange(1, 20))
        for _ in range(rng.randrange(1, 4)):
            changed[rng.randrange(min(len(changed), 40))] ^= 1 << rng.randrange(8)
        return bytes(changed)


def drive(medium: Medium, fuzz: Fuzz, count: int) -> tuple[Inbox, int, int]:
    """Feed `count` puts; returns the inbox, how many messages the medium was given and how many frames it handed on."""
    inbox = Inbox()
    given = handed = 0

    def receive(topic: str, message: Message) -> None:
        nonlocal given
        given += 1
        medium.receive(topic, message, fuzz.now_ns)

    medium.start(0)
    for topic, payload in islice(fuzz.puts(), count):
        while (wake_ns := medium.next_wake_ns()) is not None and wake_ns <= fuzz.now_ns:
            medium.wake(fuzz.now_ns)
        inbox.offer(topic, payload)
        inbox.deliver(receive)
        handed += sum(1 for _, message in medium.outbox if type(message) is Reception)
        medium.outbox.clear()
        medium.records.clear()
    medium.stop(fuzz.now_ns)
    return inbox, given, handed + sum(1 for _, message in medium.outbox if type(message) is Reception)


@pytest.mark.parametrize(
    "count", [20_000, pytest.param(1_000_000, marks=[pytest.mark.slow, pytest.mark.timeout(300)])], ids=str
)
def test_every_one_of_so_many_hostile_puts_is_counted_once(count: int) -> None:
    medium = Medium(SCENARIO, "fuzz")
    inbox, given, handed = drive(medium, Fuzz(seed=count), count)
    figures, report = inbox.figures(), medium.report()
    assert figures["samples"] == count == inbox.taken + figures["malformed"]
    frames, refused = report["frames"], report["refused"]
    gaps = frames["dropped"].pop("bus")
    assert given == frames["sent"] - gaps + report["poses"] + report["controls"] + sum(refused.values())
    assert frames["sent"] - gaps == frames["delivered"] + frames["in_flight"] + sum(frames["dropped"].values())
    assert handed == sum(report["handed"].values())
    reached = {"collision", "late", "malformed", "no_receiver", "too_large", "jammed", "degraded"}
    assert reached <= set(frames["dropped"]), "the input gets into every corner"
    least = min(frames["delivered"], report["poses"], report["controls"], gaps, *refused.values())
    assert least > count // 10_000
