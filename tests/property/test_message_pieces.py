"""Messages from end to end over any links that lose, double and reorder packets: once, whole, in order, or told why."""

import random
from collections import defaultdict
from typing import Final

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from fanet_mw import wire
from fanet_mw.delivery import receiver as receiving
from fanet_mw.delivery.receiver import Receiver
from fanet_mw.delivery.sender import EXPIRED, MOST_BYTES, Sender
from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import BROADCAST, MS, NodeId, S
from fanet_mw.wire.application_message import (
    DELIVERED,
    MOST_PIECES,
    NO_LISTENER,
    Head,
    Receipt,
    decode_piece,
    decode_receipts,
    encode_piece,
    encode_receipts,
)
from fanet_mw.wire.frame import VERSION

NODES: Final = tuple(NodeId(n) for n in (1, 2, 3, 4))
HEADER: Final = wire.Header(5, 1, 3, 0xFFFF, 3, 0, 32, 0, 3, 0).encode()
DEAF_PORT: Final = 9
TARGETS_EACH: Final = 32
"""Targets in a frame that names them."""
ROOM: Final = 400
"""Of inner frames in a packet."""


class Network:
    """Senders and receivers of a few nodes, and links that are drawn."""

    def __init__(self, seed: int, *, loss: float) -> None:
        self.random = random.Random(seed)
        self.loss = loss
        self.now_ns = 0
        self.senders = {n: Sender(n, NODES, room=lambda _: ROOM, wait_ns=S) for n in NODES}
        self.receivers = {
            n: Receiver(n, lambda piece: piece.head.port != DEAF_PORT, random=random.Random(seed)) for n in NODES
        }
        self.air: list[tuple[int, int, NodeId, NodeId, bytes, bool]] = []
        """(arrival, order, from, to, inner frames, whether these are receipts)."""
        self.got: dict[NodeId, list[tuple[NodeId, int, bytes]]] = defaultdict(list)
        self.told: dict[tuple[NodeId, int], list[tuple[int, tuple[NodeId, ...], bool]]] = defaultdict(list)
        for node in NODES:
            self.senders[node].start(1)

    def put(self, src: NodeId, dst: NodeId, inner: bytes, *, receipts: bool) -> None:
        for node in NODES:
            if node == src or dst not in (BROADCAST, node):
                continue
            for _ in range(2 if self.random.random() < 0.1 else 1):
                if self.random.random() >= self.loss:
                    at_ns = self.now_ns + self.random.randint(1, 400) * MS
                    self.air.append((at_ns, len(self.air), src, node, inner, receipts))

    def run(self, until_ns: int) -> None:
        while self.now_ns < until_ns:
            self.now_ns += 50 * MS
            arrived = sorted(item for item in self.air if item[0] <= self.now_ns)
            self.air = [item for item in self.air if item[0] > self.now_ns]
            for _, _, src, node, inner, receipts in arrived:
                if receipts:
                    for receipt in decode_receipts(HEADER + inner):
                        self.senders[node].receipt(src, receipt, self.now_ns)
                else:
                    receiver = self.receivers[node]
                    receiver.hear(src, decode_piece(HEADER + inner), HEADER, priority=3, now_ns=self.now_ns)
            for node in NODES:
                self._turn(node)

    def _turn(self, node: NodeId) -> None:
        sender, receiver = self.senders[node], self.receivers[node]
        for packet in sender.due(self.now_ns):
            self.put(node, packet.destination, packet.inner, receipts=False)
        for origin, receipts, _ in receiver.due(self.now_ns):
            self.put(node, origin, encode_receipts(receipts, node=node), receipts=True)
        self.got[node] += [(whole.origin, whole.head.number, whole.data) for whole in receiver.arrived]
        receiver.arrived.clear()
        for told in sender.told:
            self.told[node, told.number].append((told.outcome, told.targets, told.last))
        sender.told.clear()


sizes = st.one_of(st.integers(0, 3), st.integers(0, 3000))
whom = st.one_of(st.none(), st.sets(st.sampled_from(NODES), min_size=1))
drawn = st.tuples(st.sampled_from(NODES), whom, sizes, st.sampled_from([5, 6, DEAF_PORT]), st.integers(1, 3))


@examples(12)
@given(st.lists(drawn, max_size=12), st.integers(0, 2**32), st.sampled_from([0.0, 0.2, 0.5]))
def test_every_confirmed_message_arrives_once_whole_and_in_order_or_its_sender_is_told(
    plan: list[tuple[NodeId, set[NodeId] | None, int, int, int]], seed: int, loss: float
) -> None:
    network = Network(seed, loss=loss)
    sent: dict[tuple[NodeId, int], tuple[tuple[NodeId, ...], bytes, int, int]] = {}
    for node, targets, size, port, priority in plan:
        named = None if targets is None else tuple(sorted(targets - {node}))
        if named == ():
            continue
        data = network.random.randbytes(size)
        number = network.senders[node].confirmed(
            data, port=port, targets=named, priority=priority, born_us=0, lifetime_ms=20_000
        )
        meant = named or tuple(other for other in NODES if other != node)
        sent[node, number] = meant, data, port, priority
    network.run(30 * S)
    for node in NODES:
        had = network.got[node]
        assert len({(origin, number) for origin, number, _ in had}) == len(had), "once"
        flows = defaultdict(list)
        for origin, number, data in had:
            meant, content, port, priority = sent[origin, number]
            assert data == content
            assert node in meant
            assert port != DEAF_PORT
            flows[origin, meant, port, priority].append(number)
        assert all(numbers == sorted(numbers) for numbers in flows.values()), "in order"
        assert network.receivers[node].kept_bytes == 0
    for (origin, number), (meant, _, port, _) in sent.items():
        told = network.told[origin, number]
        assert [last for _, _, last in told] == [False] * (len(told) - 1) + [True]
        named_in = [target for _, targets, _ in told for target in targets]
        assert sorted(named_in) == list(meant), "of every target something is told, once"
        for outcome, targets, _ in told:
            for target in targets:
                arrived = any((o, n) == (origin, number) for o, n, _ in network.got[target])
                assert outcome != DELIVERED or arrived
                assert outcome in ((NO_LISTENER, EXPIRED) if port == DEAF_PORT else (DELIVERED, EXPIRED))
                assert loss or outcome != EXPIRED
    assert all(sender.next_wake_ns() is None for sender in network.senders.values()), "nothing is left"


@given(st.integers(0, 3000), st.booleans())
def test_an_unconfirmed_message_needs_all_its_pieces_and_is_handed_over_once(size: int, whole: bool) -> None:
    network = Network(1, loss=0.0)
    data = network.random.randbytes(size)
    _, packets = network.senders[NODES[0]].unconfirmed(
        data, port=5, destination=BROADCAST, targets=(NODES[1], NODES[2]), priority=3, born_us=0, lifetime_ms=5000
    )
    for packet in packets if whole else packets[1:]:
        network.put(NODES[0], packet.destination, packet.inner, receipts=False)
    network.run(6 * S)
    expected = [(NODES[0], 1, data)] if whole else []
    assert [network.got[node] for node in NODES[1:]] == [expected, expected, []]
    assert all(receiver.kept_bytes == 0 for receiver in network.receivers.values()), "the incomplete one has expired"


# --- bounds -----------------------------------------------------------------------------------------------------------


def test_what_a_sender_cannot_get_rid_of_fills_it_up_to_a_bound() -> None:
    sender = Sender(NodeId(1), NODES, room=lambda _: 1000, wait_ns=S)
    data = bytes(sender.fragmentation.most_bytes(port=5, targets=(NodeId(2),), confirm=False, priority=3))
    count = 0
    while not sender.full:
        sender.confirmed(data, port=5, targets=(NodeId(2),), priority=3, born_us=0, lifetime_ms=5000)
        count += 1
    assert MOST_BYTES <= count * len(data) < MOST_BYTES + len(data)
    sender.due(5 * S)
    assert not sender.full
    assert len(sender.told) == count


def test_pieces_of_messages_that_never_become_whole_fill_a_receiver_up_to_a_bound_for_each_sender() -> None:
    receiver = Receiver(NodeId(1), lambda _: True, random=random.Random(1))
    for origin in range(2, 9):
        for number in range(1, 3000):
            head = Head(0, number, 0, 64_000, 5000, 5, 0, 1000, 3, MOST_PIECES, 0)
            inner = encode_piece(head, bytes(1000), node=origin)
            receiver.hear(NodeId(origin), decode_piece(HEADER + inner), HEADER, priority=3, now_ns=0)
    assert receiver.kept_bytes <= 7 * receiving.MOST_MESSAGES_EACH * 1000
    assert receiver.kept_bytes <= receiving.MOST_BYTES
    assert receiver.not_taken > 0
    receiver.due(6 * S)
    assert receiver.kept_bytes == 0


def test_a_sender_that_has_filled_its_share_leaves_room_for_others() -> None:
    receiver = Receiver(NodeId(1), lambda _: True, random=random.Random(1))

    def hear(origin: int, number: int, piece: int) -> None:
        head = Head(0, number, 0, 5000, 5000, 5, 0, 1024, piece, 5, 0)
        inner = encode_piece(head, bytes(1024), node=origin)
        receiver.hear(NodeId(origin), decode_piece(HEADER + inner), HEADER, priority=3, now_ns=0)

    for number in range(1, 400):
        for piece in range(4):
            hear(2, number, piece)
    assert receiver.kept_bytes == receiving.MOST_BYTES_EACH
    hear(3, 1, 0)
    assert receiver.kept_bytes == receiving.MOST_BYTES_EACH + 1024


# --- the format -------------------------------------------------------------------------------------------------------


@given(st.binary(max_size=1500), st.sets(st.integers(1, 65_534), max_size=70))
def test_a_piece_is_read_as_it_was_written(data: bytes, targets: set[int]) -> None:
    head = Head(7, 8, 3, len(data), 9, 5, 1, len(data), 0, 1, 1)
    found = decode_piece(HEADER + encode_piece(head, data, node=3, targets=targets))
    assert found == (head, frozenset(targets) or None, data)


@given(st.lists(st.builds(Receipt, st.integers(0, 2**64 - 1), st.integers(0, 2**32 - 1), st.integers(0, 3))))
def test_receipts_are_read_as_they_were_written(receipts: list[Receipt]) -> None:
    assert decode_receipts(HEADER + encode_receipts(receipts, node=3)) == receipts


GOOD: Final = Head(7, 8, 3, 1500, 9, 5, 1, 1000, 1, 2, 1)
IMPOSSIBLE: Final = {
    "pieces": 65, "piece": 2, "size": 2001, "stride": 700, "previous": 8, "lifetime_ms": 0, "port": 0, "confirm": 2,
    "born_us": 2**63,
}  # fmt: skip


@pytest.mark.parametrize("key", IMPOSSIBLE)
def test_a_head_that_cannot_be_is_malformed(key: str) -> None:
    assert decode_piece(HEADER + encode_piece(GOOD, bytes(500), node=3)).head == GOOD
    with pytest.raises(MalformedFrameError):
        decode_piece(HEADER + encode_piece(GOOD._replace(**{key: IMPOSSIBLE[key]}), bytes(500), node=3))


@pytest.mark.parametrize("length", [499, 501])
def test_data_has_the_length_that_its_head_says(length: int) -> None:
    with pytest.raises(MalformedFrameError):
        decode_piece(HEADER + encode_piece(GOOD, bytes(length), node=3))


def test_pieces_that_contradict_each_other_are_malformed() -> None:
    receiver = Receiver(NodeId(1), lambda _: True, random=random.Random(1))
    for size, malformed in ((1500, False), (1400, True)):
        head = GOOD._replace(size=size)
        piece = decode_piece(HEADER + encode_piece(head, bytes(size - 1000), node=3))
        if malformed:
            with pytest.raises(MalformedFrameError, match="piece"):
                receiver.hear(NodeId(3), piece, HEADER, priority=3, now_ns=0)
        else:
            receiver.hear(NodeId(3), piece, HEADER, priority=3, now_ns=0)


@pytest.mark.parametrize(
    ("nodes", "count", "version", "is_read"),
    [
        ((5, 0xFFFE), 2, VERSION, True),
        ((5, 0xFFFE), 1, VERSION, True),
        ((5, 7), 0, VERSION, False),
        ((5, 7), TARGETS_EACH + 1, VERSION, False),
        ((5, 7), 3, VERSION, False),  # the third is node 0
        ((5, 0xFFFF), 2, VERSION, False),
        ((5, 7), 2, VERSION + 1, False),
    ],
)
def test_targets_are_nodes_as_many_as_stated(nodes: tuple[int, ...], count: int, version: int, is_read: bool) -> None:
    payload = wire.TARGETS.layout.pack(*nodes, *[0] * (TARGETS_EACH - len(nodes)), count, version)
    frame = HEADER + wire.encode_inner(wire.TARGETS, payload, node=3) + encode_piece(GOOD, bytes(500), node=3)
    if is_read:
        assert decode_piece(frame).targets == {*nodes[:count]}
    else:
        with pytest.raises(MalformedFrameError, match="targets, version"):
            decode_piece(frame)


@given(st.binary(max_size=300), st.sampled_from([wire.MESSAGE, wire.TARGETS, wire.RECEIPT, wire.CHUNK]))
def test_any_bytes_are_a_piece_and_receipts_or_malformed(payload: bytes, spec: wire.Spec) -> None:
    frame = HEADER + wire.encode_inner(spec, payload[:255], node=3) + encode_piece(GOOD, bytes(500), node=3)
    for decode in (decode_piece, decode_receipts):
        try:
            decode(frame)
        except MalformedFrameError:
            continue
