"""What becomes of messages inside one node: deadlines that a network can or cannot keep, and packets that end there."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from agents.listeners import Listeners
from agents.messenger import Messenger
from agents.submission import Sending, Submission
from fanet_mw import mavlink
from fanet_mw.application import Application, Data, Destination, Fate, Status
from fanet_mw.errors import DropReason, LocalProtocolError
from fanet_mw.node.header_check import CONTROL
from fanet_mw.node.node import Node
from fanet_mw.node.packet_watch import PacketNews
from fanet_mw.routing.direct import Direct
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from fanet_mw.wire import HEADER_BYTES, PRIORITY_BULK, PRIORITY_REPORT, filler
from fanet_mw.wire.application_message import DELIVERED, MOST_PIECES, Receipt, decode_piece

OWN, OTHER = NodeId(1), NodeId(2)
BYTES = Data(5, b"hello")
LONG = Data(5, bytes(3000))
"""Two packets."""
HEARTBEAT = mavlink.Encoder(OWN).heartbeat()
MakeScenario = Callable[..., Scenario]


class Promising(Direct):
    """States that everyone has a packet within 200 ms if packets are 50 ms apart, and nothing of shorter delays."""

    def bound_ns(self) -> int | None:
        return 200 * MS

    def least_interval_ns(self, deadline_ns: int) -> int | None:
        return 50 * MS if deadline_ns >= 200 * MS else None


class Narrow(Direct):
    """Carries packets of 300 bytes, and longer ones only of reports."""

    def most_packet_bytes(self, priority: int) -> int:
        return 420 if priority == PRIORITY_REPORT else 300


class Watcher(Application):
    """Wants to know everything."""

    name = "watcher"
    follows = tuple(Fate)


class Desk:
    """A messenger, its node, and the application that sends."""

    def __init__(self, make_scenario: MakeScenario, protocol: type[Direct] = Direct, **keys: Any) -> None:
        scenario = make_scenario(**{"nodes.count": 3, "routing.protocol": "direct", **keys})
        self.node = Node(OWN, scenario, protocol, position=Enu(0.0, 0.0, 50.0))
        self.node.start(0)
        self.application = Watcher()
        self.messenger = Messenger(self.node, Listeners([self.application]))
        self.messenger.start(0)

    def send(
        self,
        content: bytes | Data,
        *,
        at_ns: int = S,
        to: Destination = OTHER,
        confirm: bool = False,
        deadline_ns: int | None = None,
        priority: int = PRIORITY_BULK,
        lifetime_ns: int | None = None,
    ) -> int:
        sending = Sending(OWN, self.node.scenario.nodes.count)
        submission = Submission(
            *sending.content(content), *sending.whom(to), priority, confirm, lifetime_ns, deadline_ns, at_ns
        )
        return self.messenger.send(self.application, submission, now_ns=at_ns)

    def told(self, now_ns: int = S) -> list[Status]:
        assert self.messenger.next_wake_ns() == 0, "there is news, and it is told at once"
        found = [status for _, status in self.messenger.statuses(now_ns)]
        assert self.messenger.next_wake_ns() != 0
        return found


def test_a_deadline_that_the_network_cannot_keep_is_refused(make_scenario: MakeScenario) -> None:
    for content in (BYTES, HEARTBEAT):
        desk = Desk(make_scenario, Promising)
        handle = desk.send(content, deadline_ns=199 * MS)
        assert desk.told() == [Status(handle, Fate.REFUSED, S, DropReason.ADMISSION, last=True)]
        assert desk.node.requests == [], "nothing has gone out"


def test_messages_with_a_deadline_are_taken_as_far_apart_as_the_bound_assumes(make_scenario: MakeScenario) -> None:
    desk = Desk(make_scenario, Promising)
    instants = (S, S + 49 * MS, S + 50 * MS, S + 99 * MS, S + 100 * MS)
    fates = []
    for at_ns in instants:
        desk.send(BYTES, at_ns=at_ns, deadline_ns=200 * MS)
        first = desk.told(at_ns)[0]
        fates.append(first.fate)
        assert first.fate is Fate.ADMITTED or first.interval_ns == 50 * MS, "the feasible interval is told"
    admitted, refused = Fate.ADMITTED, Fate.REFUSED
    assert fates == [admitted, refused, admitted, refused, admitted], "what was refused takes no room"


def test_where_no_bound_is_stated_a_deadline_is_taken_as_it_is(make_scenario: MakeScenario) -> None:
    desk = Desk(make_scenario)
    for _ in range(2):
        desk.send(BYTES, deadline_ns=1)
        assert desk.told()[0].fate is Fate.ADMITTED


def test_a_node_that_starts_again_numbers_its_messages_above_the_earlier_ones_as_long_as_a_swarm_may_last(
    make_scenario: MakeScenario,
) -> None:
    """Readers take a confirmed message for an old one if its number is not greater than that of the last."""
    desk, starts_s = Desk(make_scenario), (0, 1, 214_748, 214_749, 429_497, 999_999)
    handles = []
    for start_s in starts_s:
        desk.messenger.start(start_s * S)
        handles.append(desk.send(BYTES, at_ns=start_s * S, confirm=True))
    assert handles == sorted(set(handles))
    assert all(CONTROL <= handle < 2 * CONTROL for handle in handles)


def test_a_dropped_piece_of_a_confirmed_message_is_no_end_of_it(make_scenario: MakeScenario) -> None:
    desk = Desk(make_scenario)
    handle = desk.send(LONG, confirm=True)
    assert [status.fate for status in desk.told()] == [Fate.ADMITTED, Fate.LET_OUT]
    (watched,) = desk.node.watch.watched
    desk.node.watch.news.append(PacketNews(watched, S, DropReason.QUEUE_FULL))
    assert desk.told() == [], "it is sent again"
    until_ns = desk.messenger.next_wake_ns()
    assert until_ns is not None
    sent = len(desk.node.requests)
    desk.messenger.wake(until_ns)
    assert len(desk.node.requests) == sent + 1, "the last piece asks what the receiver lacks"
    assert handle not in desk.node.watch.watched


def test_a_dropped_piece_of_an_unconfirmed_message_is_the_end_of_it(make_scenario: MakeScenario) -> None:
    desk = Desk(make_scenario)
    handle = desk.send(LONG, to=BROADCAST)
    desk.told()
    assert len(desk.node.watch.watched) == 2, "each of its packets may be the one that ends it"
    for reason, fate in (
        (DropReason.QUEUE_FULL, Fate.DROPPED), (DropReason.EXPIRED, Fate.EXPIRED), (DropReason.ADMISSION, Fate.REFUSED)
    ):  # fmt: skip
        desk = Desk(make_scenario)
        handle = desk.send(LONG, to=BROADCAST)
        desk.told()
        last = max(desk.node.watch.watched)
        desk.node.watch.news.append(PacketNews(last, S + MS, reason))
        assert desk.told() == [Status(handle, fate, S + MS, reason, last=True)]
        assert last not in desk.node.watch.watched
        desk.node.watch.news.append(PacketNews(last, S + MS, reason))
        assert desk.told() == [], "once"


def test_what_nobody_asks_about_is_not_told(make_scenario: MakeScenario) -> None:
    desk = Desk(make_scenario)
    desk.application.follows = (Fate.EXPIRED,)
    desk.send(BYTES)
    assert desk.messenger.statuses(S) == []
    desk.application.follows = ()
    desk.send(HEARTBEAT)
    assert len(desk.node.watch.watched) == 1, "of the plain packet nobody wants to know anything"
    assert desk.messenger.report()["admitted"] == 1, "pieces are counted all the same"


# --- lengths ----------------------------------------------------------------------------------------------------------

TO = [OTHER, (2, 3), (2, 3, 4), BROADCAST]


def refused_from(desk: Desk, make: Callable[[int], bytes | Data], **how: Any) -> int:
    """The greatest length of a message that is taken, as the error states that refuses a longer one."""
    with pytest.raises(LocalProtocolError) as error:
        desk.send(make(40_000) if make is filler else make(140_000), **how)
    most = re.fullmatch(
        r"message of \d+ bytes must be <= (-?\d+): packets of this priority have \d+ bytes", str(error.value)
    )
    assert most is not None, error.value
    with pytest.raises(LocalProtocolError):
        desk.send(make(int(most[1]) + 1), **how)
    return int(most[1])


def as_data(size: int) -> Data:
    return Data(5, bytes(size))


@pytest.mark.parametrize("confirm", [False, True])
@pytest.mark.parametrize("to", TO)
def test_the_longest_message_has_the_pieces_that_a_receipt_can_tell_of_and_all_fit(
    make_scenario: MakeScenario, to: Destination, confirm: bool
) -> None:
    desk = Desk(make_scenario, Narrow, **{"nodes.count": 5})
    most = refused_from(desk, as_data, to=to, confirm=confirm)
    desk.send(as_data(most), to=to, confirm=confirm)
    frames = [request.frame for request in desk.node.requests]
    assert all(len(frame) <= 300 for frame in frames)
    assert {decode_piece(frame).head.pieces for frame in frames} == {MOST_PIECES}


@pytest.mark.parametrize("to", TO)
def test_the_longest_confirmed_frames_are_repeated_to_a_part_of_the_swarm(
    make_scenario: MakeScenario, to: Destination
) -> None:
    """A repetition names the nodes that still lack the message, and there is room for them."""
    desk = Desk(make_scenario, Narrow, **{"nodes.count": 5})
    most = refused_from(desk, filler, to=to, confirm=True)
    number = desk.send(filler(most), to=to, confirm=True)
    desk.messenger._sender.receipt(OTHER, Receipt(0, number, DELIVERED), S)
    desk.messenger.statuses(S)
    for _ in range(3):
        due_ns = desk.messenger.next_wake_ns()
        if due_ns is not None:
            desk.messenger.wake(due_ns)
    assert len(desk.node.requests) == {OTHER: 1, (2, 3): 2 + 3 * 1, (2, 3, 4): 1 + 3 * 2, BROADCAST: 1 + 3}[to]
    assert all(len(request.frame) <= 300 for request in desk.node.requests)


def test_the_longest_packet_is_that_of_its_priority(make_scenario: MakeScenario) -> None:
    for priority, most in ((PRIORITY_BULK, 300), (PRIORITY_REPORT, 420)):
        desk = Desk(make_scenario, Narrow)
        assert refused_from(desk, filler, priority=priority) == most - HEADER_BYTES
        desk.send(filler(most - HEADER_BYTES), priority=priority)
        desk.send(as_data(3000), priority=priority)
        frames = [request.frame for request in desk.node.requests]
        assert max(map(len, frames)) == most


def test_a_message_that_no_packet_can_carry_is_refused_though_it_is_empty(make_scenario: MakeScenario) -> None:
    keys = {"radio.max_frame_bytes": 150, "nodes.count": 5, "traffic.payload_bytes": 100, "routing.hello_interval_s": 0}
    desk = Desk(make_scenario, **keys)
    desk.send(as_data(0))
    with pytest.raises(
        LocalProtocolError, match=r"message of 0 bytes must be <= -\d+: packets of this priority have 150"
    ):
        desk.send(as_data(0), to=(2, 3, 4))
    assert len(desk.node.requests) == 1


def test_what_is_refused_for_its_length_leaves_no_trace(make_scenario: MakeScenario) -> None:
    desk = Desk(make_scenario, Promising)
    with pytest.raises(LocalProtocolError):
        desk.send(filler(2290), deadline_ns=200 * MS)
    with pytest.raises(LocalProtocolError):
        desk.send(as_data(200_000), confirm=True)
    desk.send(HEARTBEAT, deadline_ns=200 * MS)
    assert desk.told()[0].fate is Fate.ADMITTED, "what was not sent keeps nothing else from being sent"
    assert desk.messenger.report() == {}


@pytest.mark.parametrize(
    ("packet", "to_one", "confirmed_to_all"),
    [(256, 10_112, 5_120), (512, 25_472, 20_480), (1024, 56_192, 51_200), (2268, 130_688, 125_696)],
)
def test_the_page_about_messages_states_how_long_they_may_be(
    make_scenario: MakeScenario, packet: int, to_one: int, confirmed_to_all: int
) -> None:
    """docs/how-to/send-messages.md"""
    keys = {"nodes.count": 33, "radio.max_frame_bytes": packet, "traffic.payload_bytes": 100}
    desk = Desk(make_scenario, **keys)
    some = tuple(range(2, 34))
    assert [refused_from(desk, as_data, to=to) for to in (OTHER, BROADCAST)] == [to_one, to_one]
    assert [refused_from(desk, as_data, to=to, confirm=True) for to in (OTHER, BROADCAST)] == [to_one, confirmed_to_all]
    assert [refused_from(desk, as_data, to=to, confirm=c) for to in ((2, 3), some) for c in (False, True)] == [
        confirmed_to_all
    ] * 4
    row = f"| {packet:,} | {to_one:,} | {confirmed_to_all:,} |"
    assert row in (Path(__file__).parents[3] / "docs/how-to/send-messages.md").read_text()
