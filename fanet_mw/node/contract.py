"""The contract between a node and a routing protocol. Every protocol is one class behind it.

The node owns identity, sequence numbers, duplicate suppression, the header and the counters. The protocol decides
what happens to a packet next, by calling its port. Both are sans-IO: instants are handed in.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from random import Random
from typing import ClassVar, Protocol

from fanet_mw.bus.messages import Reception, TxStatus
from fanet_mw.errors import DropReason
from fanet_mw.node.packet import Packet, Relay
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from fanet_mw.units import BROADCAST, Enu, NodeId
from fanet_mw.wire import Kind


class Port(Protocol):
    """What a node offers to its protocol (`port.py`)."""

    node: NodeId
    scenario: Scenario
    position: Enu
    """The position at which the node last knew itself to be."""
    clock_error_ns: int
    """The greatest error of any clock in the swarm, as far as the node has heard; 0: they are exact."""
    velocity: Enu
    """The velocity at which the node last knew itself to move [m/s]."""

    def transmit(self, frame: bytes, dst: NodeId, *, start_ns: int, wants_status: bool = False) -> int:
        """Announce a transmission; returns the request's sequence number."""

    def transmit_together(self, packets: Sequence[Packet], *, flags: int, at_ns: Sequence[int]) -> None:
        """Begin a phase of several packets: broadcast them at each of the given instants, in as few frames as they
        fit. Copies of them in that phase that come back are known.
        """

    def transmit_to(self, packet: Packet, dst: NodeId, *, flags: int, start_ns: int) -> int:
        """Send a packet to one neighbor, in a phase that begins here; returns the request's number, whose status
        comes. Copies of the packet in that phase that come back are known.
        """

    def relay(self, relay: Relay) -> None:
        """Pass a flooded packet on, one hop more, in a frame of its own."""

    def relay_together(self, relays: Sequence[Relay]) -> None:
        """Pass flooded packets on, one hop more each, in as few frames as they fit; a frame goes at the first instant
        of those in it.
        """

    def announce(
        self, kind: Kind, inner: bytes, *, now_ns: int, flags: int, hop_limit: int, destination: NodeId = BROADCAST
    ) -> Packet:
        """Make a control packet of this node, with its next sequence number, marked as handled here."""

    def forwarded(self, packet: Packet, *, flags: int) -> bytes:
        """The bytes of a packet for its next hop: with one hop more, and this node as previous hop."""

    def drop(self, reason: DropReason, packet: Packet, *, now_ns: int) -> None: ...

    def mark(self, packet: Packet, *, flags: int) -> None:
        """Know copies of a packet in the phase of these flags that come from now on."""

    def forget(self, packet: Packet) -> None:
        """Treat a later copy of a packet as new: this node was not to handle it yet, or its custody has passed on."""

    def record(self, record: Record) -> None: ...

    def stream(self, use: str) -> Random: ...


class RoutingProtocol(ABC):
    """One routing protocol at one node."""

    origin_flags: ClassVar[int] = 0
    """The flags with which the node makes this protocol's application packets."""

    def __init__(self, port: Port) -> None:
        self._port = port

    def start(self, now_ns: int) -> None:  # noqa: B027  (stateless protocols have nothing to start)
        """Begin: the node is up."""

    @abstractmethod
    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        """Take a packet of this node's application; its first frame may go from `due_ns`, one lead after its birth."""

    @abstractmethod
    def receive(self, packet: Packet, reception: Reception, *, now_ns: int) -> Sequence[Relay] | None:
        """Take in the first copy of a packet in its phase. The node delivers it to the application.

        Returns what is passed on because of it, if anything: the node sends that, together with what else came
        in the same frame. A protocol sends anything else through its port.
        """

    def hello_inner(self, room: int, *, now_ns: int) -> bytes:
        """The inner frames that this protocol adds to the node's hello, in at most so many bytes."""
        return b""

    def hello_share(self, *, now_ns: int) -> float:
        """The part of the hello interval after which the next hello should go."""
        return 1.0

    def hello_start_ns(self, start_ns: int) -> int:
        """The instant from which a hello may go that is due at `start_ns`."""
        return start_ns

    def on_hello(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:  # noqa: B027
        """Take in a neighbor's hello."""

    def on_impersonation(self, packet: Packet, *, now_ns: int) -> None:  # noqa: B027
        """Take in a packet that another node sent in the name of this one; it goes no further."""

    def on_copy(self, key: int, *, now_ns: int) -> None:  # noqa: B027
        """Take in another copy, in the same phase, of a packet that was handled before (`duplicates.key_of`).

        It may call off what is planned; nothing may become due sooner, because the node does not ask again.
        """

    def on_status(self, status: TxStatus, *, now_ns: int) -> None:  # noqa: B027
        """Take in how a transmission ended; only those that asked for it are told of."""

    def wake(self, now_ns: int) -> None:  # noqa: B027
        """Act at an instant that `next_wake_ns` has named."""

    def next_wake_ns(self) -> int | None:
        return None

    def waiting(self) -> int:
        """The number of packets that wait in the protocol."""
        return 0

    def bound_ns(self) -> int | None:
        """The delay within which all nodes have the next packet of this node; None: no bound is stated."""
        return None

    def clusters(self) -> Mapping[NodeId, tuple[NodeId, ...]]:
        """The nodes of each cluster by head, the head first, as far as this node knows; empty: there are none."""
        return {}

    def least_interval_ns(self, deadline_ns: int) -> int | None:
        """The least interval between packets of this node that meets this delay at all nodes; None: unknown,
        or there is none.
        """
        return None

    def report(self) -> Mapping[str, object]:
        """JSON-able state, for people."""
        return {}
