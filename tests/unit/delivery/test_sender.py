"""The sending side of messages, hand-driven: what goes out when, to whom, and what the application is told."""

from fanet_mw import wire
from fanet_mw.delivery.sender import EXPIRED, PieceToSend, Sender, Told
from fanet_mw.units import BROADCAST, MS, US, NodeId, S
from fanet_mw.wire.application_message import DELIVERED, MISSING, NO_LISTENER, Piece, Receipt, decode_piece

OWN, A, B, C = NodeId(1), NodeId(2), NodeId(3), NodeId(4)
HEADER = wire.Header(5, 1, OWN, BROADCAST, OWN, 0, 32, 0, 3, 0).encode()
WAIT_NS = 2 * S
"""Patience with a target that has never sent a receipt."""
BORN_NS = S


def made() -> Sender:
    sender = Sender(OWN, (OWN, A, B, C), room=lambda _: 400, wait_ns=WAIT_NS)
    sender.start(1)
    return sender


def send(
    sender: Sender,
    data: bytes = b"x",
    *,
    to: tuple[NodeId, ...] | None = (A,),
    port: int = 5,
    lifetime_ms: int = 60_000,
) -> int:
    return sender.confirmed(data, port=port, targets=to, priority=3, born_us=BORN_NS // US, lifetime_ms=lifetime_ms)


def piece(packet: PieceToSend) -> Piece:
    return decode_piece(HEADER + packet.inner)


def pieces(packets: list[PieceToSend]) -> list[int]:
    return [piece(packet).head.piece for packet in packets]


def delivered(sender: Sender, number: int, node: NodeId, at_ns: int) -> None:
    sender.receipt(node, Receipt(0, number, DELIVERED), at_ns)


def test_alone_in_its_swarm_a_node_has_told_everyone() -> None:
    sender = Sender(OWN, (OWN,), room=lambda _: 400, wait_ns=WAIT_NS)
    sender.start(1)
    number = send(sender, to=None)
    assert sender.told == [Told(number, DELIVERED, (), last=True)]
    assert sender.due(BORN_NS) == []
    assert sender.next_wake_ns() is None


def test_without_a_receipt_a_message_is_sent_again_and_patience_doubles_up_to_eight_times() -> None:
    sender, at_ns = made(), BORN_NS
    send(sender)
    assert len(sender.due(at_ns)) == 1
    for wait_ns in (WAIT_NS, 2 * WAIT_NS, 4 * WAIT_NS, 8 * WAIT_NS, 8 * WAIT_NS):
        assert sender.next_wake_ns() == at_ns + wait_ns
        assert sender.due(at_ns + wait_ns - 1) == []
        at_ns += wait_ns
        assert len(sender.due(at_ns)) == 1
    assert sender.repeated == 5


def test_a_message_is_given_up_at_the_end_of_its_lifetime_and_neither_sooner_nor_later() -> None:
    sender = made()
    number = send(sender, to=(A, B), lifetime_ms=500)
    sender.due(BORN_NS)
    delivered(sender, number, A, BORN_NS + 100 * MS)
    end_ns = BORN_NS + 500 * MS
    assert sender.next_wake_ns() == end_ns
    sender.due(end_ns - 1)
    assert sender.told == [Told(number, DELIVERED, (A,), last=False)]
    assert sender.due(end_ns) == []
    assert sender.told[1:] == [Told(number, EXPIRED, (B,), last=True)]
    assert sender.next_wake_ns() is None
    delivered(sender, number, B, end_ns + 1)
    assert len(sender.told) == 2, "a receipt that comes afterwards changes nothing"


def test_a_message_that_was_never_let_out_is_given_up_as_well() -> None:
    sender = made()
    for _ in range(40):  # more than the window lets out
        send(sender, lifetime_ms=500)
    out = sender.due(BORN_NS)
    assert len(out) == 32
    sender.due(BORN_NS + 500 * MS)
    assert [told.outcome for told in sender.told] == [EXPIRED] * 40
    assert send(sender) == 41
    assert len(sender.due(BORN_NS + 500 * MS)) == 1, "the window is free again"


def test_only_what_is_missing_is_sent_again() -> None:
    sender = made()
    number = send(sender, bytes(1000))
    first = sender.due(BORN_NS)
    assert pieces(first) == [0, 1, 2, 3]
    assert [packet.first for packet in first] == [True, False, False, False]
    sender.receipt(A, Receipt(0b1011, number, MISSING), BORN_NS + 100 * MS)
    again = sender.due(BORN_NS + WAIT_NS)
    assert pieces(again) == [2]
    assert not again[0].first


def test_a_target_that_has_every_piece_is_asked_again_by_the_last_one() -> None:
    sender = made()
    number = send(sender, bytes(1000))
    sender.due(BORN_NS)
    sender.receipt(A, Receipt(0b1111, number, MISSING), BORN_NS + 100 * MS)
    assert pieces(sender.due(BORN_NS + WAIT_NS)) == [3]


def test_a_target_that_has_said_nothing_is_asked_by_the_last_piece_and_then_sent_what_it_lacks() -> None:
    sender = made()
    number = send(sender, bytes(1000))
    sender.due(BORN_NS)
    assert pieces(sender.due(BORN_NS + WAIT_NS)) == [3]
    sender.receipt(A, Receipt(0b1000, number, MISSING), BORN_NS + WAIT_NS + 100 * MS)
    assert pieces(sender.due(BORN_NS + 3 * WAIT_NS)) == [0, 1, 2]


def test_patience_begins_when_the_last_piece_has_left_the_node() -> None:
    waiting = {77}
    sender = Sender(OWN, (OWN, A), room=lambda _: 400, wait_ns=WAIT_NS, holds=waiting.__contains__)
    sender.start(1)
    number = send(sender, bytes(1000))
    for seq, _ in zip(range(74, 78), sender.due(BORN_NS), strict=True):
        sender.handed_over(number, seq)
    assert sender.due(BORN_NS + WAIT_NS) == []
    waiting.clear()
    assert sender.next_wake_ns() == BORN_NS + 2 * WAIT_NS
    assert pieces(sender.due(BORN_NS + 2 * WAIT_NS)) == [3]


def test_pieces_that_few_lack_go_to_each_of_them_and_the_others_to_all() -> None:
    sender = Sender(OWN, [NodeId(n) for n in range(1, 12)], room=lambda _: 400, wait_ns=WAIT_NS)
    number = send(sender, bytes(900), to=None)
    every = (1 << len(sender.due(BORN_NS))) - 1
    for node in range(2, 12):
        held = every & ~0b1 & ~(0b10 if node == 5 else 0)
        sender.receipt(NodeId(node), Receipt(held, number, MISSING), BORN_NS + MS)
    again = [(packet.destination, piece(packet).head.piece) for packet in sender.due(BORN_NS + WAIT_NS)]
    assert again == [(NodeId(5), 1), (BROADCAST, 0)]


def test_a_receipt_teaches_how_long_to_wait_for_the_next() -> None:
    """RFC 6298: 400 ms smoothed and 200 of variation, so 1200 ms; then half of both differences."""
    sender = made()
    first = send(sender)
    sender.due(BORN_NS)
    delivered(sender, first, A, BORN_NS + 400 * MS)
    at_ns = BORN_NS + S
    second = send(sender)
    sender.due(at_ns)
    assert sender.next_wake_ns() == at_ns + 1200 * MS
    delivered(sender, second, A, at_ns + 800 * MS)
    at_ns += 2 * S
    send(sender)
    sender.due(at_ns)
    smooth_ns, varies_ns = 400 * MS + 400 * MS // 8, 200 * MS + (400 - 200) * MS // 4
    assert sender.next_wake_ns() == at_ns + smooth_ns + 4 * varies_ns


def test_a_receipt_after_a_repetition_teaches_nothing_because_nobody_knows_to_which_copy_it_is() -> None:
    sender = made()
    first = send(sender)
    sender.due(BORN_NS)
    sender.due(BORN_NS + WAIT_NS)
    delivered(sender, first, A, BORN_NS + WAIT_NS + MS)
    at_ns = BORN_NS + 2 * WAIT_NS
    send(sender)
    sender.due(at_ns)
    assert sender.next_wake_ns() == at_ns + WAIT_NS


def test_two_targets_are_sent_to_one_by_one_and_three_together() -> None:
    sender = made()
    send(sender, to=(A, B))
    assert [(packet.destination, piece(packet).targets) for packet in sender.due(BORN_NS)] == [(A, None), (B, None)]
    third = send(sender, to=(A, B, C))
    assert [(packet.destination, piece(packet).targets) for packet in sender.due(BORN_NS)] == [(BROADCAST, None)]
    sender.receipt(A, Receipt(0, third, DELIVERED), BORN_NS + MS)
    again = [packet for packet in sender.due(BORN_NS + WAIT_NS) if packet.number == third]
    assert [packet.destination for packet in again] == [B, C]


def test_a_part_of_the_swarm_is_named_in_each_packet() -> None:
    sender = Sender(OWN, [NodeId(n) for n in range(1, 9)], room=lambda _: 400, wait_ns=WAIT_NS)
    send(sender, to=(A, B, C))
    assert [(p.destination, piece(p).targets) for p in sender.due(BORN_NS)] == [(BROADCAST, frozenset((A, B, C)))]


def test_a_message_names_the_one_before_it_in_its_flow_as_long_as_that_is_open() -> None:
    sender = made()
    first, other_port = send(sender, lifetime_ms=500), send(sender, port=6)
    second = send(sender)
    before = {packet.number: piece(packet).head.previous for packet in sender.due(BORN_NS)}
    assert before == {first: 0, other_port: 0, second: first}
    sender.due(BORN_NS + 500 * MS)  # the first has expired
    again = {packet.number: piece(packet).head.previous for packet in sender.due(BORN_NS + WAIT_NS)}
    assert again == {other_port: 0, second: 0}, "it is passed over"


def test_a_target_waits_only_for_messages_that_it_lacks() -> None:
    """A has confirmed the first message and starts again, with no memory of it; B, which is gone, keeps it open."""
    sender = made()
    first = send(sender, to=(A, B))
    sender.due(BORN_NS)
    delivered(sender, first, A, BORN_NS)
    send(sender, to=(A, B))
    before = {packet.destination: piece(packet).head.previous for packet in sender.due(BORN_NS)}
    assert before == {A: 0, B: first}


def test_a_message_to_all_names_one_before_it_that_any_of_them_lacks() -> None:
    sender = made()
    first, second = send(sender, to=None), send(sender, to=None)
    sender.due(BORN_NS)
    for node in (A, B):
        delivered(sender, first, node, BORN_NS)
        delivered(sender, second, node, BORN_NS)
    third = send(sender, to=None)
    before = {packet.number: piece(packet).head.previous for packet in sender.due(BORN_NS)}
    assert before == {third: second}
    delivered(sender, second, C, BORN_NS)
    (again,) = {piece(p).head.previous for p in sender.due(BORN_NS + WAIT_NS) if p.number == third}
    assert again == first
    delivered(sender, third, B, BORN_NS + WAIT_NS)
    packets = sender.due(BORN_NS + 10 * WAIT_NS)
    assert {p.destination: piece(p).head.previous for p in packets if p.number == third} == {A: 0, C: first}


def test_a_target_that_is_gone_holds_up_no_message_to_another() -> None:
    """A message of three packets to A, which never answers, is repeated for ten minutes; B answers at once."""
    sender = made()
    send(sender, bytes(700), to=(A,), lifetime_ms=600_000)
    for second in range(1, 600):
        now_ns = second * S
        sender.due(now_ns)
        if second % 60 == 0:
            number = sender.confirmed(b"x", port=6, targets=(B,), priority=3, born_us=now_ns // US, lifetime_ms=30_000)
            assert [packet.number for packet in sender.due(now_ns)] == [number]
            delivered(sender, number, B, now_ns)


def test_with_one_target_gone_messages_to_all_go_out_as_soon_as_they_are_sent() -> None:
    sender = made()
    for second in range(1, 200):
        now_ns = second * S
        numbers = {packet.number for packet in sender.due(now_ns)}
        if second % 5 == 0:
            number = sender.confirmed(
                bytes(700), port=5, targets=None, priority=3, born_us=now_ns // US, lifetime_ms=30_000
            )
            numbers |= {packet.number for packet in sender.due(now_ns)}
            assert number in numbers
        for number in numbers:
            for node in (B, C):
                delivered(sender, number, node, now_ns)


def test_of_repetitions_those_go_first_that_were_repeated_least() -> None:
    sender, at_ns = made(), BORN_NS
    old = send(sender, bytes(700), to=(A,))
    for _ in range(6):
        sender.due(at_ns)
        at_ns = sender.next_wake_ns() or 0
    young = sender.confirmed(b"x", port=6, targets=(B,), priority=3, born_us=at_ns // US, lifetime_ms=60_000)
    at_ns += 10 * S  # both are due; the window is at its least
    first = [packet.number for packet in sender.due(at_ns)]
    assert first[0] == young
    again = [packet.number for packet in sender.due(at_ns + 17 * S)]
    assert again.index(young) < again.index(old) if old in again else young in again


def test_of_messages_to_one_target_the_one_goes_first_for_which_it_waits_however_often_it_was_repeated() -> None:
    sender = made()
    old = send(sender, bytes(700), lifetime_ms=600_000)
    for second in range(60):
        sender.due(BORN_NS + second * S)
    young = send(sender, bytes(700), lifetime_ms=600_000)
    sender.due(BORN_NS + 60 * S)
    at_ns = BORN_NS + 80 * S  # both are due; the window is at its least
    assert {packet.number for packet in sender.due(at_ns)} == {old}
    delivered(sender, old, A, at_ns)
    assert {packet.number for packet in sender.due(at_ns)} == {young}


def test_when_a_target_has_a_message_the_next_one_goes_before_those_of_a_target_that_is_gone() -> None:
    sender = made()
    first, second = send(sender, bytes(700), lifetime_ms=600_000), send(sender, bytes(700), lifetime_ms=600_000)
    sender.confirmed(bytes(700), port=6, targets=(B,), priority=3, born_us=BORN_NS // US, lifetime_ms=600_000)
    for each in range(60):
        sender.due(BORN_NS + each * S)
    at_ns = BORN_NS + 80 * S
    sender.due(at_ns)
    delivered(sender, first, A, at_ns + S)
    later = [p.number for each in range(1, 20) for p in sender.due(at_ns + each * S)]
    assert later[0] == second


def test_a_message_that_its_target_has_and_keeps_back_for_one_before_it_is_not_sent_again() -> None:
    sender = made()
    first, second = send(sender, bytes(700)), send(sender, bytes(700))
    sender.due(BORN_NS)
    sender.receipt(A, Receipt(0b111, second, MISSING), BORN_NS + 100 * MS)
    later = [p for at_ns in range(BORN_NS, BORN_NS + 40 * S, S) for p in sender.due(at_ns)]
    assert {packet.number for packet in later} == {first}
    delivered(sender, first, A, BORN_NS + 40 * S)
    again = [p for at_ns in range(BORN_NS + 40 * S, BORN_NS + 57 * S, S) for p in sender.due(at_ns)]
    assert {packet.number for packet in again} == {second}, "its own receipt was lost"


def test_a_target_that_answers_after_a_long_silence_is_soon_sent_what_it_lacks() -> None:
    sender, at_ns = made(), BORN_NS
    number = send(sender, bytes(1000))
    for _ in range(4):
        sender.due(at_ns)
        at_ns = sender.next_wake_ns() or 0
    sender.due(at_ns)
    sender.receipt(A, Receipt(0b1000, number, MISSING), at_ns + 100 * MS)
    assert sender.next_wake_ns() == at_ns + WAIT_NS, "without the doublings"
    assert pieces(sender.due(at_ns + WAIT_NS)) == [0, 1, 2]


def test_a_message_that_was_kept_back_teaches_nothing_about_how_long_receipts_take() -> None:
    sender = made()
    first = send(sender)
    sender.due(BORN_NS)
    sender.receipt(A, Receipt(0b1, first, MISSING), BORN_NS + 400 * MS)
    delivered(sender, first, A, BORN_NS + 1900 * MS)
    at_ns = BORN_NS + 2 * S
    send(sender)
    sender.due(at_ns)
    assert sender.next_wake_ns() == at_ns + 1200 * MS, "400 ms and four times 200, as of one receipt"


def test_a_repetition_halves_the_window_and_a_target_that_has_all_widens_it_by_one() -> None:
    sender = made()
    numbers = [send(sender) for _ in range(100)]
    assert len(sender.due(BORN_NS)) == 32
    after_timeout = sender.due(BORN_NS + WAIT_NS)
    assert len(after_timeout) == 2 + 2, "every one of the 32 has halved it, to two pieces of either kind"
    for number in numbers[:2]:
        delivered(sender, number, A, BORN_NS + WAIT_NS + MS)
    assert len(sender.due(BORN_NS + WAIT_NS + MS)) == 2 + 4, "two new ones were under way already"


def test_who_has_nobody_that_listens_is_told_apart_and_is_not_asked_again() -> None:
    sender = made()
    number = send(sender, to=(A, B))
    sender.due(BORN_NS)
    sender.receipt(A, Receipt(0, number, NO_LISTENER), BORN_NS + MS)
    assert sender.told == [Told(number, NO_LISTENER, (A,), last=False)]
    assert [packet.destination for packet in sender.due(BORN_NS + WAIT_NS)] == [B]


def test_the_most_urgent_message_goes_first() -> None:
    sender = made()
    for priority in (3, 1, 2):
        sender.confirmed(b"x", port=5, targets=(A,), priority=priority, born_us=1_000_000, lifetime_ms=60_000)
    assert [packet.priority for packet in sender.due(BORN_NS)] == [1, 2, 3]


def test_numbers_go_on_from_the_first_and_flows_are_told_apart() -> None:
    sender = Sender(OWN, (OWN, A, B, C), room=lambda _: 400, wait_ns=WAIT_NS)
    sender.start(70_000)
    assert [send(sender), send(sender, to=(B,)), send(sender)] == [70_000, 70_001, 70_002]
    flows = {packet.number: piece(packet).head.flow for packet in sender.due(BORN_NS)}
    assert flows[70_000] == flows[70_002] != flows[70_001]


def test_receipts_that_overtake_each_other_add_up() -> None:
    sender = made()
    number = send(sender, bytes(1000))
    sender.due(BORN_NS)
    for held in (0b0110, 0b0010):
        sender.receipt(A, Receipt(held, number, MISSING), BORN_NS + 100 * MS)
    assert pieces(sender.due(BORN_NS + WAIT_NS)) == [0, 3]


def test_together_go_the_pieces_that_any_target_lacks_and_who_lacks_some_is_named() -> None:
    sender = Sender(OWN, [NodeId(n) for n in range(1, 9)], room=lambda _: 400, wait_ns=WAIT_NS)
    number = send(sender, bytes(900), to=None)
    first = sender.due(BORN_NS)
    assert {piece(packet).targets for packet in first} == {None}
    every = (1 << len(first)) - 1
    for node in range(2, 6):
        delivered(sender, number, NodeId(node), BORN_NS + MS)
    for node in (6, 7, 8):
        sender.receipt(NodeId(node), Receipt(every & ~0b11, number, MISSING), BORN_NS + MS)
    again = sender.due(BORN_NS + WAIT_NS)
    assert pieces(again) == [0, 1]
    assert {piece(packet).targets for packet in again} == {frozenset((6, 7, 8))}
