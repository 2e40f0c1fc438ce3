"""The messages of a node's applications: what they send goes into packets, what packets bring goes to who listens.

    plain MAVLink frames to one node or all         -> one packet, as it is
    bytes, a set of nodes, or to be confirmed       -> pieces, receipts (`fanet_mw.delivery`)

The sender is told of everything that its `follows` names. What is told waits until the input that caused it has been
handled, so that no application is called while it calls.
"""

from collections import Counter, deque
from collections.abc import Callable, Collection, Mapping
from typing import Any, Final, NamedTuple

from fanet_mw import wire
from fanet_mw.application import Application, Data, Destination, Fate, Received, Status
from fanet_mw.delivery.receiver import Receiver, Whole
from fanet_mw.delivery.sender import EXPIRED, Packet, Sender
from fanet_mw.errors import DropReason, LocalProtocolError
from fanet_mw.node.node import Node
from fanet_mw.node.packet import Packet as RoutedPacket
from fanet_mw.node.plausible import CONTROL, RESTART_STEP_NS
from fanet_mw.rng import stream
from fanet_mw.units import BROADCAST, MAX_NODES, MS, US, NodeId, S, earliest, seconds_to_ns
from fanet_mw.wire.message import (
    DELIVERED,
    MAVLINK_PORT,
    MOST_LIFETIME_MS,
    NO_LISTENER,
    RECEIPT_BYTES,
    Piece,
    decode_piece,
    decode_receipts,
    encode_receipts,
)

_MOST_WATCHED: Final = 8192
"""Packets of which is remembered whose they are."""
_MOST_PORT: Final = 0xFFFF
_RECEIPT_APP: Final = "receipt"


class _Watched(NamedTuple):
    """Whose packet it is, and what the node is to be asked about it."""

    application: Application
    handle: int
    first: bool
    confirmed: bool


class Messenger:
    """The messages of one node's applications."""

    def __init__(self, node: Node, listeners: Callable[[int, int], Collection[Application]]) -> None:
        """`listeners`: who listens, by port and MAVLink message id."""
        scenario = node.scenario
        clustered = scenario.routing.protocol == "clustered"
        wait_ns = S + (2 * seconds_to_ns(scenario.clusters.flooding_period_s) if clustered else 0)
        self._node = node
        self._listeners = listeners
        self._room = scenario.radio.max_frame_bytes - wire.HEADER_BYTES
        self._sender = Sender(node.node, scenario.node_ids, most_bytes=self._room, wait_ns=wait_ns)
        self._receiver = Receiver(node.node, self._has_listener, random=stream(scenario.seed, "receipts", node.node))
        self._in_time_ns: int | None = None
        """When the last message with a deadline was taken."""
        self._owners: dict[int, Application] = {}
        """By handle: who sent a message that is to be confirmed."""
        self._watched: dict[int, _Watched] = {}
        """By sequence number."""
        self._statuses: deque[tuple[Application, Status]] = deque()
        self.counts: Counter[str] = Counter()
        """What became of messages in pieces, by fate, and how many were sent and handed over."""

    def start(self, now_ns: int) -> None:
        self._sender.start(CONTROL | now_ns // RESTART_STEP_NS % CONTROL)

    # --- out ------------------------------------------------------------------------------------------------------

    def send(
        self,
        application: Application,
        content: bytes | Data,
        *,
        destination: Destination,
        priority: int,
        confirm: bool,
        lifetime_ns: int | None,
        deadline_ns: int | None,
        born_ns: int,
        now_ns: int,
    ) -> int:
        port, data = (MAVLINK_PORT, content) if isinstance(content, bytes) else content
        to, targets = self._whom(destination)
        plain = isinstance(content, bytes) and not confirm and not targets and lifetime_ns is None
        named = 0 if len(targets) < 2 else len(targets)
        if not plain:
            self._check(content, port, data, named)
        if deadline_ns is not None:
            in_time, interval_ns = self._judge(deadline_ns, born_ns)
            if not in_time:
                return self._refused(application, DropReason.ADMISSION, now_ns, interval_ns=interval_ns)
        if plain:
            return self._plain(application, data, to, priority=priority, born_ns=born_ns, now_ns=now_ns)
        self.counts["sent"] += 1
        own_ns = self._node.scenario.routing.lifetime_ns(priority) if lifetime_ns is None else lifetime_ns
        lifetime_ms, born_us = max(1, min(MOST_LIFETIME_MS, own_ns // MS)), born_ns // US
        if not confirm:
            handle, packets = self._sender.unconfirmed(
                data, port=port, destination=to, targets=targets if named else (), priority=priority,
                born_us=born_us, lifetime_ms=lifetime_ms,
            )  # fmt: skip
            self._tell(application, Status(handle, Fate.ADMITTED, now_ns))
            for packet in packets:
                self._originate(application, packet, confirmed=False, born_ns=born_ns, now_ns=now_ns)
            return handle
        if self._sender.full:
            return self._refused(application, DropReason.QUEUE_FULL, now_ns)
        handle = self._sender.confirmed(
            data, port=port, targets=None if to == BROADCAST and not targets else targets or (to,), priority=priority,
            born_us=born_us, lifetime_ms=lifetime_ms,
        )  # fmt: skip
        self._owners[handle] = application
        self._tell(application, Status(handle, Fate.ADMITTED, now_ns))
        self._send_due(now_ns)
        return handle

    def _whom(self, destination: Destination) -> tuple[NodeId, tuple[NodeId, ...]]:
        """The destination of the packets, and the nodes that are named one by one."""
        own, most = self._node.node, self._node.scenario.nodes.count
        if isinstance(destination, int):
            if destination != BROADCAST and not 0 < destination <= MAX_NODES:
                raise LocalProtocolError(f"destination = {destination} must be a node id, or BROADCAST")
            return NodeId(destination), ()
        nodes = tuple(sorted({NodeId(node) for node in destination} - {own}))
        if not nodes or not 0 < nodes[0] <= nodes[-1] <= most:
            raise LocalProtocolError(f"destination = {sorted(destination)} must be ids of other nodes <= {most}")
        return (nodes[0], ()) if len(nodes) == 1 else (BROADCAST, nodes)

    def _check(self, content: bytes | Data, port: int, data: bytes, named: int) -> None:
        if isinstance(content, Data) and not 0 < port <= _MOST_PORT:
            raise LocalProtocolError(f"port = {port} must be in [1, {_MOST_PORT}]")
        one_piece = self._room - wire.OVERHEAD - wire.MESSAGE.layout.size - named * 3
        most = one_piece if port == MAVLINK_PORT else self._sender.most_bytes(named)
        if len(data) > most:
            raise LocalProtocolError(f"message of {len(data)} bytes must be <= {most} (radio.max_frame_bytes)")

    def _judge(self, deadline_ns: int, born_ns: int) -> tuple[bool, int | None]:
        """Whether a message can be there in time, and the least interval between such messages, where that is known.

        Where the network states no bound, every message is taken. Messages that are taken are at least the interval
        apart, which is what the bound assumes.
        """
        if self._node.bound_ns() is None:
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
        self._tell(application, Status(handle, Fate.REFUSED, now_ns, reason, last=True, interval_ns=interval_ns))
        return handle

    def _plain(
        self, application: Application, frames: bytes, to: NodeId, *, priority: int, born_ns: int, now_ns: int
    ) -> int:
        seq = self._node.send(
            frames, destination=to, priority=priority, app=application.name, born_ns=born_ns, now_ns=now_ns,
            watch=bool(application.follows),
        )  # fmt: skip
        if application.follows:
            self._tell(application, Status(seq, Fate.ADMITTED, now_ns))
            self._watch(seq, _Watched(application, seq, first=True, confirmed=False))
        return seq

    def _originate(
        self, application: Application, packet: Packet, *, confirmed: bool, born_ns: int, now_ns: int
    ) -> None:
        seq = self._node.send(
            packet.inner, destination=packet.destination, priority=packet.priority, app=application.name,
            born_ns=born_ns, now_ns=now_ns, watch=packet.first or not confirmed,
        )  # fmt: skip
        if packet.first or not confirmed:
            self._watch(seq, _Watched(application, packet.number, packet.first, confirmed))

    def _watch(self, seq: int, watched: _Watched) -> None:
        self._watched[seq] = watched
        if len(self._watched) > _MOST_WATCHED:
            self._unwatch(next(iter(self._watched)))

    def _unwatch(self, seq: int) -> None:
        del self._watched[seq]
        self._node.watched.discard(seq)

    def _send_due(self, now_ns: int) -> None:
        for packet in self._sender.due(now_ns):
            owner = self._owners.get(packet.number)
            if owner is not None:
                self._originate(owner, packet, confirmed=True, born_ns=now_ns, now_ns=now_ns)

    # --- in -------------------------------------------------------------------------------------------------------

    def piece(self, packet: RoutedPacket, now_ns: int) -> None:
        """A packet with a piece of a message; raises MalformedFrameError."""
        piece = decode_piece(packet.frame)
        self._receiver.hear(packet.origin, piece, packet.frame, priority=packet.header.priority, now_ns=now_ns)

    def receipts(self, packet: RoutedPacket, now_ns: int) -> None:
        """A packet with receipts; raises MalformedFrameError."""
        for receipt in decode_receipts(packet.frame):
            self._sender.receipt(packet.origin, receipt, now_ns)

    def _has_listener(self, piece: Piece) -> bool:
        return bool(self._listeners(piece.head.port, _message_id(piece.data)))

    def arrived(self) -> list[tuple[Application, Received]]:
        """Messages to hand over now, each to all that listen to it."""
        found = []
        for whole in self._receiver.arrived:
            message = _received(whole)
            self.counts["received"] += 1
            found += [(a, message) for a in self._listeners(whole.head.port, _message_id(whole.data))]
        self._receiver.arrived.clear()
        return found

    # --- what became of it ----------------------------------------------------------------------------------------

    def _tell(self, application: Application, status: Status) -> None:
        if status.handle & CONTROL:
            self.counts[status.fate.value] += 1
        if status.fate in application.follows:
            self._statuses.append((application, status))

    def statuses(self, now_ns: int) -> list[tuple[Application, Status]]:
        """What is to be told now; what an application does about it is told of later."""
        for seq, t_ns, reason in self._node.fates:
            self._fate(seq, t_ns, reason)
        self._node.fates.clear()
        for number, outcome, targets, last in self._sender.told:
            owner = self._owners.get(number)
            if owner is None:
                continue
            fate = {EXPIRED: Fate.EXPIRED, DELIVERED: Fate.ACKNOWLEDGED, NO_LISTENER: Fate.UNWANTED}.get(outcome)
            self._tell(owner, Status(number, fate or Fate.EXPIRED, now_ns, nodes=targets, last=last))
            if last:
                del self._owners[number]
        self._sender.told.clear()
        found = list(self._statuses)
        self._statuses.clear()
        return found

    def _fate(self, seq: int, t_ns: int, reason: DropReason | None) -> None:
        """The node let a packet out, or dropped it."""
        watched = self._watched.get(seq)
        if watched is None:
            return
        application, handle, first, confirmed = watched
        if reason is None:
            if first and (not confirmed or handle in self._owners):  # else it is over: nobody waits to hear of it
                self._tell(application, Status(handle, Fate.LET_OUT, t_ns))
            return
        self._unwatch(seq)
        if confirmed:
            return  # it is sent again
        fate = {DropReason.ADMISSION: Fate.REFUSED, DropReason.EXPIRED: Fate.EXPIRED}.get(reason, Fate.DROPPED)
        deadline_s = self._node.scenario.traffic.deadline_s
        refused = fate is Fate.REFUSED and deadline_s is not None
        interval_ns = self._node.least_interval_ns(seconds_to_ns(deadline_s or 0)) if refused else None
        self._tell(application, Status(handle, fate, t_ns, reason, last=True, interval_ns=interval_ns))

    # --- time -----------------------------------------------------------------------------------------------------

    def wake(self, now_ns: int) -> None:
        self._send_due(now_ns)
        for origin, receipts, priority in self._receiver.due(now_ns):
            most = self._room // RECEIPT_BYTES
            for at in range(0, len(receipts), most):
                inner = encode_receipts(receipts[at : at + most], node=self._node.node)
                self._node.send(
                    inner, destination=origin, priority=priority, app=_RECEIPT_APP, born_ns=now_ns, now_ns=now_ns
                )

    def next_wake_ns(self) -> int | None:
        if self._statuses or self._node.fates or self._sender.told:
            return 0  # at once
        return earliest(self._sender.next_wake_ns(), self._receiver.next_wake_ns())

    def report(self) -> Mapping[str, Any]:
        """Counters, for people; nothing when no application has sent or got anything by way of here."""
        if not self.counts:
            return {}
        more = {
            "pieces_repeated": self._sender.repeated,
            "pieces_not_taken": self._receiver.not_taken,
            "given_up_here": self._receiver.expired,
        }
        return {**dict(sorted(self.counts.items())), **more}


def _message_id(frames: bytes) -> int:
    return int.from_bytes(frames[7:10], "little")


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
