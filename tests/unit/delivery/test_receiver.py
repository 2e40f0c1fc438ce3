"""The receiving side of messages, hand-driven: what is handed over and let go of, and what the sender hears."""

import random

from fanet_mw.delivery.receiver import MOST_MESSAGES_EACH, RECEIPT_NS, Receiver
from fanet_mw.units import MS, US, NodeId, S
from fanet_mw.wire.application_message import DELIVERED, GIVEN_UP, MISSING, NO_LISTENER, Head, Piece

OWN, FROM = NodeId(1), NodeId(2)
BORN_NS = S
LIFETIME_NS = 500 * MS
DEAF_PORT = 9
LATEST_RECEIPT_NS = RECEIPT_NS + 80 * MS


def made() -> Receiver:
    return Receiver(OWN, lambda piece: piece.head.port != DEAF_PORT, random=random.Random(1))


def head(
    number: int = 7, *, piece: int = 0, pieces: int = 1, previous: int = 0, confirm: int = 1, port: int = 5
) -> Head:
    return Head(BORN_NS // US, number, previous, pieces, LIFETIME_NS // MS, port, 1, 1, piece, pieces, confirm)


def hear(
    receiver: Receiver, which: Head, at_ns: int, *, targets: frozenset[int] | None = None, priority: int = 3
) -> None:
    piece = Piece(which, targets, bytes([which.piece]))
    receiver.hear(FROM, piece, b"packet %d" % which.piece, priority=priority, now_ns=at_ns)


def numbers(receiver: Receiver) -> list[int]:
    found = [whole.head.number for whole in receiver.arrived]
    receiver.arrived.clear()
    return found


def said(receiver: Receiver, at_ns: int) -> dict[int, tuple[int, int]]:
    """Outcome and pieces held, by message, of the receipts that are due."""
    return {r.number: (r.outcome, r.held) for _, receipts, _ in receiver.due(at_ns) for r in receipts}


def test_a_message_is_handed_over_with_its_last_piece_and_its_pieces_are_in_order() -> None:
    receiver = made()
    hear(receiver, head(piece=1, pieces=3), BORN_NS)
    hear(receiver, head(piece=2, pieces=3), BORN_NS)
    assert receiver.arrived == []
    assert receiver.kept_bytes == 2
    hear(receiver, head(piece=0, pieces=3), BORN_NS)
    assert [(whole.data, whole.frame) for whole in receiver.arrived] == [(b"\0\1\2", b"packet 0")]
    assert receiver.kept_bytes == 0


def test_what_comes_at_the_end_of_its_lifetime_or_later_is_given_up_and_its_sender_is_told() -> None:
    for at_ns, expected in ((BORN_NS + LIFETIME_NS - 1, [7]), (BORN_NS + LIFETIME_NS, [])):
        receiver = made()
        hear(receiver, head(), at_ns)
        assert numbers(receiver) == expected
        assert said(receiver, at_ns + LATEST_RECEIPT_NS)[7][0] == (DELIVERED if expected else GIVEN_UP)
        assert receiver.kept_bytes == 0


def test_a_message_from_a_clock_that_is_ahead_lives_no_longer_than_its_lifetime() -> None:
    receiver = made()
    hear(receiver, head(piece=0, pieces=2), BORN_NS - 300 * MS)
    receiver.due(BORN_NS - 300 * MS + LIFETIME_NS - 1)
    assert receiver.expired == 0
    receiver.due(BORN_NS - 300 * MS + LIFETIME_NS)
    assert receiver.expired == 1


def test_pieces_of_what_never_becomes_whole_are_let_go_of_at_the_end_of_its_lifetime() -> None:
    receiver = made()
    hear(receiver, head(piece=0, pieces=2, confirm=0), BORN_NS)
    assert receiver.next_wake_ns() == BORN_NS + LIFETIME_NS
    receiver.due(BORN_NS + LIFETIME_NS - 1)
    assert receiver.kept_bytes == 1
    receiver.due(BORN_NS + LIFETIME_NS)
    assert (receiver.kept_bytes, receiver.expired, receiver.next_wake_ns()) == (0, 1, None)


def test_a_message_waits_for_the_one_before_it_until_its_sender_has_given_that_up() -> None:
    receiver = made()
    hear(receiver, head(8, previous=7), BORN_NS)
    assert numbers(receiver) == []
    hear(receiver, head(7), BORN_NS)
    assert numbers(receiver) == [7, 8]
    hear(receiver, head(10, previous=9), BORN_NS)
    assert numbers(receiver) == []
    hear(receiver, head(10, previous=0), BORN_NS)  # the same piece again: 9 is passed over
    assert numbers(receiver) == [10]
    hear(receiver, head(9), BORN_NS)
    assert numbers(receiver) == [], "it comes too late for its place"
    assert said(receiver, BORN_NS + LATEST_RECEIPT_NS) == {
        7: (DELIVERED, 0), 8: (DELIVERED, 0), 9: (GIVEN_UP, 0), 10: (DELIVERED, 0),
    }  # fmt: skip


def test_a_message_does_not_wait_for_one_to_which_nobody_listens() -> None:
    receiver = made()
    hear(receiver, head(7, port=DEAF_PORT), BORN_NS)
    hear(receiver, head(8, previous=7), BORN_NS)
    assert numbers(receiver) == [8]
    assert said(receiver, BORN_NS + LATEST_RECEIPT_NS) == {7: (NO_LISTENER, 0), 8: (DELIVERED, 0)}
    assert receiver._incoming == {}


def test_a_message_of_which_pieces_keep_coming_is_answered_once_when_it_is_whole() -> None:
    receiver, last_ns = made(), BORN_NS + 4 * 100 * MS
    for piece in range(5):
        hear(receiver, head(piece=piece, pieces=5), BORN_NS + piece * 100 * MS)
        assert said(receiver, BORN_NS + (piece + 1) * 100 * MS - 1) == ({} if piece < 4 else {7: (DELIVERED, 0)})
    assert said(receiver, last_ns + S) == {}


def test_what_is_missing_is_told_when_a_gap_is_longer_than_gaps_usually_are() -> None:
    """Pieces that come twice a second are waited for longer than those that come every 40 ms."""
    waited: list[int] = []
    for gap_ns in (40 * MS, 500 * MS):
        receiver, last_ns = made(), BORN_NS
        for piece in range(30):
            which = head(piece=piece, pieces=60)._replace(lifetime_ms=60_000)
            last_ns = BORN_NS + piece * gap_ns
            assert said(receiver, last_ns) == {}, "more pieces are coming"
            hear(receiver, which, last_ns)
        waited.append(next(ns for ns in range(0, 6 * S, 10 * MS) if said(receiver, last_ns + ns)))
    short_ns, long_ns = waited
    assert 300 * MS <= short_ns <= 400 * MS
    assert 500 * MS < long_ns <= 1200 * MS


def test_who_is_sent_a_piece_again_says_at_once_what_it_lacks() -> None:
    receiver = made()
    hear(receiver, head(piece=1, pieces=2), BORN_NS)
    hear(receiver, head(piece=1, pieces=2), BORN_NS + 100 * MS)
    assert said(receiver, BORN_NS + 100 * MS + LATEST_RECEIPT_NS) == {7: (MISSING, 0b10)}


def test_the_time_until_its_sender_sends_missing_pieces_again_is_no_gap_between_pieces() -> None:
    waits_ns = []
    for rounds in (1, 6):
        receiver, at_ns = made(), BORN_NS
        for piece in range(2 * rounds):
            hear(receiver, head(piece=piece, pieces=60)._replace(lifetime_ms=60_000), at_ns)
            if piece % 2:
                told_ns = next(ns for ns in range(0, 6 * S, 10 * MS) if said(receiver, at_ns + ns))
                at_ns += 3 * S  # after its receipt the sender begins anew
            else:
                at_ns += 40 * MS
        waits_ns.append(told_ns)
    assert waits_ns[1] < waits_ns[0]


def test_a_message_to_which_nobody_listens_keeps_the_place_of_those_before_it() -> None:
    """7 is still on its way: 9 may not overtake it because nobody listens to 8."""
    receiver = made()
    hear(receiver, head(8, previous=7, port=DEAF_PORT), BORN_NS)
    hear(receiver, head(9, previous=8), BORN_NS)
    assert numbers(receiver) == []
    assert said(receiver, BORN_NS + LATEST_RECEIPT_NS) == {8: (NO_LISTENER, 0), 9: (MISSING, 1)}
    hear(receiver, head(7), BORN_NS + 200 * MS)
    assert numbers(receiver) == [7, 9]
    assert said(receiver, BORN_NS + 200 * MS + LATEST_RECEIPT_NS)[9] == (DELIVERED, 0)


def test_all_messages_that_wait_for_the_same_one_are_handed_over_with_it() -> None:
    """Each names the youngest before it that this node lacks; an incomplete one that was given up is passed over."""
    receiver = made()
    hear(receiver, head(8, previous=7, port=DEAF_PORT), BORN_NS)
    hear(receiver, head(9, previous=7), BORN_NS)
    hear(receiver, head(10, previous=9, pieces=2), BORN_NS)
    hear(receiver, head(11, previous=9), BORN_NS)
    hear(receiver, head(7), BORN_NS)
    assert numbers(receiver) == [7, 9, 11]
    hear(receiver, head(10, previous=9, piece=1, pieces=2), BORN_NS)
    assert numbers(receiver) == [], "it comes too late for its place"


def test_a_message_to_which_nobody_listens_and_whose_turn_never_comes_is_not_counted_as_expired() -> None:
    receiver = made()
    hear(receiver, head(8, previous=7, port=DEAF_PORT), BORN_NS)
    receiver.due(BORN_NS + LIFETIME_NS)
    assert (receiver.expired, receiver.kept_bytes) == (0, 0)
    for number in range(20, 20 + 2 * MOST_MESSAGES_EACH):
        hear(receiver, head(number, previous=number - 1, port=DEAF_PORT), BORN_NS)
    assert len(receiver._incoming) == MOST_MESSAGES_EACH
    assert receiver.not_taken == 0, "all are answered"


def test_what_is_not_confirmed_waits_for_nobody_and_is_answered_by_nobody() -> None:
    receiver = made()
    hear(receiver, head(8, confirm=0), BORN_NS)
    hear(receiver, head(7, confirm=0), BORN_NS)
    assert numbers(receiver) == [8, 7]
    assert said(receiver, BORN_NS + S) == {}


def test_a_message_that_comes_twice_is_handed_over_once_and_confirmed_twice() -> None:
    receiver = made()
    for at_ns in (BORN_NS, BORN_NS + 200 * MS):
        hear(receiver, head(), at_ns)
        assert said(receiver, at_ns + LATEST_RECEIPT_NS) == {7: (DELIVERED, 0)}
    assert numbers(receiver) == [7]


def test_what_is_missing_is_told_once_no_more_pieces_come() -> None:
    receiver, at_ns = made(), BORN_NS
    for piece in (0, 2):
        which = head(piece=piece, pieces=4)._replace(lifetime_ms=5000)
        hear(receiver, which, at_ns, priority=3 - piece)
        at_ns += 200 * MS
        assert receiver.due(at_ns) == []
    due_ns = BORN_NS + 200 * MS + 1275 * MS + 80 * MS
    ((origin, receipts, priority),) = receiver.due(due_ns)
    assert (origin, priority) == (FROM, 1)
    assert [(r.number, r.held, r.outcome) for r in receipts] == [(7, 0b101, MISSING)]
    assert receiver.due(due_ns + S)[:1] == []


def test_who_is_not_named_keeps_and_says_nothing_and_who_has_no_listener_says_so() -> None:
    receiver = made()
    hear(receiver, head(7), BORN_NS, targets=frozenset((3, 4)))
    assert said(receiver, BORN_NS + LATEST_RECEIPT_NS) == {}
    hear(receiver, head(8, port=DEAF_PORT), BORN_NS, targets=frozenset((OWN, 4)))
    assert said(receiver, BORN_NS + LATEST_RECEIPT_NS) == {8: (NO_LISTENER, 0)}
    assert numbers(receiver) == []


def test_flows_and_senders_are_told_apart() -> None:
    receiver = made()
    for origin, flow in ((FROM, 2), (NodeId(3), 1)):
        which = head(8, previous=7)._replace(flow=flow)
        receiver.hear(origin, Piece(which, None, b"x"), b"", priority=3, now_ns=BORN_NS)
    hear(receiver, head(7), BORN_NS)
    assert numbers(receiver) == [7], "what waits for a 7 of another flow, or of another sender, waits on"
    receiver.due(BORN_NS + LIFETIME_NS)
    assert (receiver.expired, receiver.kept_bytes, receiver.next_wake_ns()) == (2, 0, None)


def test_the_receipts_of_several_messages_go_together_at_the_priority_of_the_most_urgent() -> None:
    receiver = made()
    for number, priority in ((7, 3), (8, 1), (9, 2)):
        hear(receiver, head(number), BORN_NS, priority=priority)
    ((_, receipts, priority),) = receiver.due(BORN_NS + LATEST_RECEIPT_NS)
    assert ([receipt.number for receipt in receipts], priority) == ([7, 8, 9], 1)
    assert receiver.due(BORN_NS + S) == []
    assert receiver.next_wake_ns() is None or receiver.next_wake_ns() == BORN_NS + LIFETIME_NS


def test_one_sender_takes_no_more_than_its_room_and_has_it_again_when_its_messages_are_whole() -> None:
    receiver = made()
    for round_number in range(2):
        for number in range(MOST_MESSAGES_EACH + 1):
            hear(receiver, head(2000 * round_number + number, piece=0, pieces=2, confirm=0), BORN_NS)
        assert receiver.not_taken == round_number + 1, "one message too many"
        assert receiver.kept_bytes == MOST_MESSAGES_EACH
        for number in range(MOST_MESSAGES_EACH):
            hear(receiver, head(2000 * round_number + number, piece=1, pieces=2, confirm=0), BORN_NS)
        assert len(numbers(receiver)) == MOST_MESSAGES_EACH
        assert receiver.kept_bytes == 0


def test_a_piece_for_which_there_was_no_room_is_taken_when_it_comes_again() -> None:
    receiver = made()
    for number in range(1, MOST_MESSAGES_EACH + 1):
        hear(receiver, head(number, piece=0, pieces=2, confirm=0), BORN_NS)
    hear(receiver, head(9000), BORN_NS)
    assert said(receiver, BORN_NS + LATEST_RECEIPT_NS) == {9000: (MISSING, 0)}
    hear(receiver, head(1, piece=1, pieces=2, confirm=0), BORN_NS)
    hear(receiver, head(9000), BORN_NS)
    assert numbers(receiver) == [1, 9000]


def test_a_message_that_waits_in_one_flow_is_not_handed_over_for_one_of_another() -> None:
    receiver = made()
    hear(receiver, head(9, previous=6, port=5), BORN_NS)
    hear(receiver, head(10, previous=7, port=6)._replace(flow=2), BORN_NS)
    hear(receiver, head(7, port=6)._replace(flow=2), BORN_NS)
    assert numbers(receiver) == [7, 10]
    hear(receiver, head(6, port=5), BORN_NS)
    assert numbers(receiver) == [6, 9]


def test_of_all_senders_together_so_many_messages_wait_and_no_more() -> None:
    receiver = made()
    for number in range(1, 1 + 12 * 400):
        sender = NodeId(2 + number % 12)
        receiver.hear(sender, Piece(head(number, pieces=2), None, b"\0"), b"", priority=3, now_ns=BORN_NS)
    assert len(receiver._incoming) == 4096
    assert receiver.not_taken == 12 * 400 - 4096
