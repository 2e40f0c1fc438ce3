"""What becomes of messages inside one node: deadlines that a network can or cannot keep, and packets that end there."""

from collections.abc import Callable
from typing import Any

from agents.listeners import Listeners
from agents.messenger import Messenger
from agents.submission import Sending, Submission
from fanet_mw import mavlink
from fanet_mw.application import Application, Data, Destination, Fate, Status
from fanet_mw.errors import DropReason
from fanet_mw.node.node import Node
from fanet_mw.node.packet_watch import PacketNews
from fanet_mw.routing.direct import Direct
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from fanet_mw.wire import PRIORITY_BULK

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
    ) -> int:
        sending = Sending(OWN, self.node.scenario.nodes.count)
        submission = Submission(
            *sending.content(content), *sending.whom(to), PRIORITY_BULK, confirm, None, deadline_ns, at_ns
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
    assert len(desk.node.requests) == 2 * sent
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
