"""Carries the messages of a node's applications: what they send goes into packets, and what arrives goes to listeners.

Plain MAVLink frames to one node or all are one packet, unchanged; all else goes in pieces with receipts
(`fanet_mw.delivery`). Applications are told what has become of their messages after the input was handled, so that none
is called while it is calling itself.
"""

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from agents.listeners import Listeners
from agents.submission import Submission
from fanet_mw import wire
from fanet_mw.application import Application, Fate, Received, Status
from fanet_mw.delivery.receiver import Receiver, Whole
from fanet_mw.delivery.sender import EXPIRED, PieceToSend, Sender, Told
from fanet_mw.errors import DropReason, LocalProtocolError
from fanet_mw.node.header_check import CONTROL
from fanet_mw.node.node import Node
from fanet_mw.node.packet import Packet
from fanet_mw.node.packet_watch import PacketNews, RadioStage
from fanet_mw.part_failure import is_ours
from fanet_mw.rng import stream
from fanet_mw.units import BROADCAST, MS, US, NodeId, S, seconds_to_ns
from fanet_mw.wire import PRIORITY_BULK
from fanet_mw.wire.application_message import (
    DELIVERED,
    MAVLINK_PORT,
    MOST_LIFETIME_MS,
    NO_LISTENER,
    RECEIPT_BYTES,
    decode_piece,
    decode_receipts,
    encode_receipts,
)
from fanet_mw.wire.frame import message_id

_MOST_WATCHED: Final = 8192
"""The greatest number of packets whose application is remembered."""
_OUTCOMES: Final = {EXPIRED: Fate.EXPIRED, DELIVERED: Fate.ACKNOWLEDGED, NO_LISTENER: Fate.UNWANTED}
_STAGES: Final = {
    RadioStage.ANNOUNCED: Fate.LET_OUT,
    RadioStage.SENT: Fate.SENT,
    RadioStage.NOT_TRIED: Fate.TURNED_AWAY,
}
_REASONS: Final = {DropReason.ADMISSION: Fate.REFUSED, DropReason.EXPIRED: Fate.EXPIRED}
"""The fates of packets that are dropped for these reasons; for all other reasons it is DROPPED."""


class _Watched(NamedTuple):
    """The application and the message to which a packet belongs."""

    application: Application
    handle: int
    first: bool
    confirmed: bool
    """True for a piece of a confirmed message; if such a piece is dropped, it is sent again."""


class Statuses:
    """The statuses of one node's messages that have yet to be reported."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._owners: dict[int, Application] = {}
        """The application that has sent each unfinished confirmed message, by the message's handle."""
        self._watched: dict[int, _Watched] = {}
        self.waiting: deque[tuple[Application, Status]] = deque()
        self.counts: Counter[str] = Counter()

    def tell(self, application: Application, status: Status) -> None:
        if status.handle & CONTROL:
            self.counts[status.fate.value] += 1
        if status.fate in application.follows:
            self.waiting.append((application, status))

    def own(self, handle: int, application: Application) -> None:
        self._owners[handle] = application

    def owner(self, handle: int) -> Application | None:
        """The application that has sent a confirmed message; None if the message is finished."""
        return self._owners.get(handle)

    def watch(self, seq: int, application: Application, handle: int, *, first: bool, confirmed: bool) -> None:
        """Remember to which application's message a packet belongs, whether it carries all of it or a piece."""
        self._watched[seq] = _Watched(application, handle, first, confirmed)
        if len(self._watched) > _MOST_WATCHED:
            self._unwatch(next(iter(self._watched)))

    def _unwatch(self, seq: int) -> None:
        del self._watched[seq]
        self._node.watch.end(seq)

    def take(self, told: list[Told], now_ns: int) -> list[tuple[Application, Status]]:
        """The statuses to report now. `told` is the news of the sender; both lists of news are emptied."""
        if self._node.watch.news:
            for news in self._node.watch.news:
                self._packet_fate(news)
            self._node.watch.news.clear()
        for number, outcome, targets, last in told:
            owner = self._owners.get(number)
            if owner is None:
                continue
            fate = _OUTCOMES.get(outcome, Fate.EXPIRED)
            self.tell(owner, Status(number, fate, now_ns, nodes=targets, last=last))
            if last:
                del self._owners[number]
        told.clear()
        found = list(self.waiting)
        self.waiting.clear()
        return found

    def _packet_fate(self, news: PacketNews) -> None:
        seq, t_ns, reason = news
        watched = self._watched.get(seq)
        if watched is None:
            return
        application, handle, first, confirmed = watched
        if isinstance(reason, RadioStage):
            # a confirmed message without an owner is finished, and no application waits for its status
            if first and (not confirmed or handle in self._owners):
                self.tell(application, Status(handle, _STAGES[reason], t_ns))
            return
        self._unwatch(seq)
        if confirmed:
            return  # it will be sent again
        fate = _REASONS.get(reason, Fate.DROPPED)
        deadline_s = self._node.scenario.traffic.deadline_s
        refused = fate is Fate.REFUSED and deadline_s is not None and self._node.bounds(PRIORITY_BULK)
        interval_ns = self._node.least_interval_ns(seconds_to_ns(deadline_s or 0)) if refused else None
        self.tell(application, Status(handle, fate, t_ns, reason, last=True, interval_ns=interval_ns))


_MESSAGE_STEP_NS: Final = 500 * US
"""A node sends fewer messages than one in this time, so a restarted one begins above all its earlier numbers. Readers
compare them, and in the longest swarm, 1,000,000 s, they do not begin again.
"""
_RECEIPT_APP: Final = "receipt"
_RADIO_FATES: Final = frozenset((Fate.SENT, Fate.TURNED_AWAY))


def _follows_radio(application: Application) -> bool:
    """True if the radio must report on the application's packets; each report costs a message on the bus."""
    return not _RADIO_FATES.isdisjoint(application.follows)


class Messenger:
    """The messages of one node's applications."""

    def __init__(self, node: Node, listeners: Listeners) -> None:
        scenario = node.scenario
        clustered = scenario.routing.protocol == "clustered"
        wait_ns = S + (2 * seconds_to_ns(scenario.clusters.flooding_period_s) if clustered else 0)
        self._node = node
        self._listeners = listeners
        self._sender = Sender(node.node, scenario.node_ids, room=self._room, wait_ns=wait_ns, holds=node.holds)
        self._receiver = Receiver(
            node.node, listens=lambda piece: bool(self._of(piece.head.port, piece.data)),
            random=stream(scenario.seed, "receipts", node.node),
        )  # fmt: skip
        self._in_time_ns: int | None = None
        """The instant at which the last message with a deadline was accepted."""
        self._statuses = Statuses(node)
        self._counts: Counter[str] = Counter()

    def start(self, now_ns: int) -> None:
        self._sender.start(CONTROL | now_ns // _MESSAGE_STEP_NS % CONTROL)

    # --- out ------------------------------------------------------------------------------------------------------

    def send(self, application: Application, submission: Submission, *, now_ns: int) -> int:
        """Send what an application has submitted; returns the handle of the message, which statuses will name."""
        port, data, to, targets, priority, confirm, lifetime_ns, deadline_ns, born_ns = submission
        plain = port == MAVLINK_PORT and not confirm and not targets and lifetime_ns is None
        most = self._room(priority) if plain else self._most_bytes(submission)
        if len(data) > most:
            room = self._node.most_packet_bytes(priority)
            raise LocalProtocolError(
                f"message of {len(data)} bytes must be <= {most}: packets of this priority have {room} bytes"
            )
        if confirm and self._sender.full:
            return self._refused(application, DropReason.QUEUE_FULL, now_ns)
        if deadline_ns is not None:
            in_time, interval_ns = self._admission(deadline_ns, born_ns, priority)
            if not in_time:
                return self._refused(application, DropReason.ADMISSION, now_ns, interval_ns=interval_ns)
        if plain:
            return self._plain(application, data, to, priority=priority, born_ns=born_ns, now_ns=now_ns)
        self._counts["sent"] += 1
        own_ns = self._node.scenario.routing.lifetime_ns(priority) if lifetime_ns is None else lifetime_ns
        lifetime_ms, born_us = max(1, min(MOST_LIFETIME_MS, own_ns // MS)), born_ns // US
        packets: Sequence[PieceToSend] = ()
        if confirm:
            handle = self._sender.confirmed(
                data, port=port, targets=_targets(to, targets), priority=priority, born_us=born_us,
                lifetime_ms=lifetime_ms,
            )  # fmt: skip
            self._statuses.own(handle, application)
        else:
            handle, packets = self._sender.unconfirmed(
                data, port=port, destination=to, targets=targets, priority=priority, born_us=born_us,
                lifetime_ms=lifetime_ms,
            )  # fmt: skip
        self._statuses.tell(application, Status(handle, Fate.ADMITTED, now_ns))
        for packet in packets:
            self._originate(application, packet, confirmed=False, born_ns=born_ns, now_ns=now_ns)
        if confirm:
            self._send_due(now_ns)
        return handle

    def _room(self, priority: int) -> int:
        return self._node.most_packet_bytes(priority) - wire.HEADER_BYTES

    def _most_bytes(self, submission: Submission) -> int:
        """The length of the longest message of this kind that goes in pieces."""
        to, targets = submission.to, submission.targets
        return self._sender.fragmentation.most_bytes(
            port=submission.port, targets=_targets(to, targets), confirm=submission.confirm,
            priority=submission.priority,
        )  # fmt: skip

    def _admission(self, deadline_ns: int, born_ns: int, priority: int) -> tuple[bool, int | None]:
        """Whether a message can arrive in time, and the least interval between such; without a bound all can."""
        if self._node.bound_ns() is None or not self._node.bounds(priority):
            return True, None
        interval_ns = self._node.least_interval_ns(deadline_ns)
        if interval_ns is None or (self._in_time_ns is not None and born_ns < self._in_time_ns + interval_ns):
            return False, interval_ns
        self._in_time_ns = born_ns
        return True, interval_ns

    def _refused(
        self, application: Application, reason: DropReason, now_ns: int, *, interval_ns: int | None = None
    ) -> int:
        handle = self._sender.take_number()
        self._statuses.tell(
            application, Status(handle, Fate.REFUSED, now_ns, reason, last=True, interval_ns=interval_ns)
        )
        return handle

    def _plain(
        self, application: Application, frames: bytes, to: NodeId, *, priority: int, born_ns: int, now_ns: int
    ) -> int:
        if not application.follows:
            return self._node.send(
                frames, destination=to, priority=priority, app=application.name, born_ns=born_ns, now_ns=now_ns,
                jitter=not is_ours(application),
            )  # fmt: skip
        seq = self._node.send(
            frames, destination=to, priority=priority, app=application.name, born_ns=born_ns, now_ns=now_ns,
            watch=True, watch_radio=_follows_radio(application), jitter=not is_ours(application),
        )  # fmt: skip
        self._statuses.tell(application, Status(seq, Fate.ADMITTED, now_ns))
        self._statuses.watch(seq, application, seq, first=True, confirmed=False)
        return seq

    def _originate(
        self, application: Application, packet: PieceToSend, *, confirmed: bool, born_ns: int, now_ns: int
    ) -> int:
        watched = packet.first or not confirmed
        seq = self._node.send(
            packet.inner, destination=packet.destination, priority=packet.priority, app=application.name,
            born_ns=born_ns, now_ns=now_ns, watch=watched, watch_radio=packet.first and _follows_radio(application),
            jitter=not is_ours(application),
        )  # fmt: skip
        if watched:
            self._statuses.watch(seq, application, packet.number, first=packet.first, confirmed=confirmed)
        return seq

    def _send_due(self, now_ns: int) -> None:
        for packet in self._sender.due(now_ns):
            owner = self._statuses.owner(packet.number)
            if owner is not None:
                seq = self._originate(owner, packet, confirmed=True, born_ns=now_ns, now_ns=now_ns)
                self._sender.handed_over(packet.number, seq)

    # --- in -------------------------------------------------------------------------------------------------------

    def piece(self, packet: Packet, now_ns: int) -> None:
        """A packet with a piece of a message was received; raises MalformedFrameError."""
        piece = decode_piece(packet.frame)
        self._receiver.hear(packet.origin, piece, packet.frame, priority=packet.header.priority, now_ns=now_ns)

    def receipts(self, packet: Packet, now_ns: int) -> None:
        """A packet with receipts was received; raises MalformedFrameError."""
        for receipt in decode_receipts(packet.frame):
            self._sender.receipt(packet.origin, receipt, now_ns)

    def _of(self, port: int, data: bytes) -> Sequence[Application]:
        """The applications that listen to a message, by its port or by the id of its MAVLink frame."""
        if port == MAVLINK_PORT:
            return self._listeners.of_message(message_id(data))
        return self._listeners.of_port(port)

    @property
    def owes_receipts(self) -> bool:
        return self._receiver.owes_receipts

    def has_news(self) -> bool:
        """True if there is a message to hand over, or news of a message that was sent."""
        return bool(self._receiver.arrived or self._sender.told or self._statuses.waiting or self._node.watch.news)

    def arrived(self) -> list[tuple[Application, Received]]:
        """The messages to hand over now, each with an application that listens to it."""
        if not self._receiver.arrived:
            return []
        arrived = [(whole, _received(whole)) for whole in self._receiver.arrived]
        self._receiver.arrived.clear()
        self._counts["received"] += len(arrived)
        return [(a, message) for whole, message in arrived for a in self._of(whole.head.port, whole.data)]

    def statuses(self, now_ns: int) -> list[tuple[Application, Status]]:
        """The statuses to report now; what applications then do is reported later."""
        return self._statuses.take(self._sender.told, now_ns)

    # --- time -----------------------------------------------------------------------------------------------------

    def wake(self, now_ns: int) -> None:
        self._send_due(now_ns)
        for origin, receipts, priority in self._receiver.due(now_ns):
            most = self._room(priority) // RECEIPT_BYTES
            for at in range(0, len(receipts), most):
                inner = encode_receipts(receipts[at : at + most], node=self._node.node)
                self._node.send(
                    inner, destination=origin, priority=priority, app=_RECEIPT_APP, born_ns=now_ns, now_ns=now_ns
                )

    def next_wake_ns(self) -> int | None:
        if self._sender.told or self._statuses.waiting or self._node.watch.news:
            return 0  # at once
        send_ns, receive_ns = self._sender.next_wake_ns(), self._receiver.next_wake_ns()
        return send_ns if receive_ns is None or (send_ns is not None and send_ns < receive_ns) else receive_ns

    def report(self) -> Mapping[str, Any]:
        counts = self._counts + self._statuses.counts
        if not counts:
            return {}
        more = {
            "pieces_repeated": self._sender.repeated,
            "pieces_not_taken": self._receiver.not_taken,
            "given_up_here": self._receiver.expired,
        }
        return {**dict(sorted(counts.items())), **more}


def _targets(to: NodeId, named: tuple[NodeId, ...]) -> tuple[NodeId, ...] | None:
    """The nodes that a message is for; None if it is for all."""
    return None if to == BROADCAST and not named else named or (to,)


def _received(whole: Whole) -> Received:
    header = wire.decode_header(whole.frame)
    native = whole.head.port == MAVLINK_PORT
    return Received(
        whole.origin,
        NodeId(header.destination),
        header.priority,
        whole.head.born_us * US,
        header.hops + 1,
        whole.frame[: wire.HEADER_BYTES] + whole.data if native else whole.frame,
        whole.head.port,
        None if native else whole.data,
    )
