"""The contract between a node and a routing protocol; each protocol is one class behind it.

The node owns identity, sequence numbers, duplicate suppression, the header and the counters. The protocol decides what
happens to a packet next, and sends through its port. Both are sans-IO: each instant is an argument.

A packet may travel in several phases, told by flags of its header: flooded, carried towards a cluster head, or neither
(`duplicates.py`). A node handles a packet once in each phase; what comes again in that phase is a duplicate.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
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
    """The node's last known position."""
    clock_error_ns: int
    """The greatest error of any clock in the swarm, as far as this node knows; 0 if all clocks are exact."""
    velocity: Enu
    """The node's last known velocity [m/s]."""
    deaf: bool
    """True while the node hears nobody, which all that it sends then states (`FLAG_DEAF`)."""

    def transmit(self, frame: bytes, dst: NodeId, start_ns: int, wants_status: bool = False, until_ns: int = 0) -> int:
        """Announce a transmission to the radio; returns the sequence number of the request.

        The radio drops the frame if it cannot begin it before `until_ns`; 0 leaves that to the radio. With
        `wants_status` it reports how the transmission ended (`on_status`).
        """

    def transmit_together(
        self, packets: Sequence[Packet], *, flags: int, at_ns: Sequence[int], until_ns: int = 0
    ) -> None:
        """Broadcast several packets in the phase of `flags`: at each of these instants, in as few frames as possible,
        and before `until_ns` as in `transmit`. Copies that come back in that phase count as duplicates.
        """

    def transmit_to(self, packet: Packet, dst: NodeId, *, flags: int, start_ns: int) -> int:
        """Send a packet to one neighbor in the phase of `flags`; returns the sequence number of the request, whose
        status will be reported. Copies that come back in that phase count as duplicates.
        """

    def relay(self, relay: Relay) -> None:
        """Pass a flooded packet on in a frame of its own; its hop count grows by one."""

    def relay_together(self, relays: Sequence[Relay]) -> None:
        """Pass flooded packets on in as few frames as possible, each at the earliest instant of the packets in it."""

    def announce(
        self, kind: Kind, inner: bytes, *, now_ns: int, flags: int, hop_limit: int, destination: NodeId = BROADCAST
    ) -> Packet:
        """Make a control packet of this node, with its next sequence number; its copies count as duplicates here."""

    def forwarded(self, packet: Packet, *, flags: int) -> bytes:
        """The bytes of a packet for its next hop: the hop count is one greater, and this node is the previous hop."""

    def drop(self, reason: DropReason, packet: Packet, *, now_ns: int) -> None:
        """Count and record that this node gives up a packet."""

    def mark(self, packet: Packet, *, flags: int) -> None:
        """From now on, treat copies of a packet in the phase of these flags as duplicates."""

    def forget(self, packet: Packet) -> None:
        """Treat a later copy of a packet as new: this node was not to handle it yet, or has handed over its custody."""

    def record(self, record: Record) -> None:
        """Put a record into the trace."""

    def stream(self, use: str) -> Random:
        """The random numbers of this node for one use, the same in each run with the same seed."""


class RoutingProtocol(ABC):
    """One routing protocol at one node."""

    origin_flags: ClassVar[int] = 0
    """The flags of the application packets that this node originates."""
    contends_at_once: ClassVar[bool] = False
    """True if what this node floods contends as soon as it is due; on an event of several nodes that needs jitter."""

    def __init__(self, port: Port) -> None:
        self._port = port

    def start(self, now_ns: int) -> None:  # noqa: B027  (stateless protocols have nothing to start)
        """The node has started."""

    @abstractmethod
    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        """Handle a packet of an own application; its first frame may be sent from `due_ns`, one lead after its
        generation.
        """

    @abstractmethod
    def receive(self, packet: Packet, reception: Reception, *, now_ns: int) -> Sequence[Relay] | None:
        """Handle the first copy of a packet in its phase; the node delivers it to the application itself.

        Returns the relays of this packet, if any. The node sends them together with relays of other packets that came
        in the same frame. Anything else a protocol sends through its port.
        """

    def hello_inner(self, room: int, *, now_ns: int) -> bytes:
        """The inner frames that this protocol adds to the node's hello, at most `room` bytes."""
        return b""

    def hello_share(self, *, now_ns: int) -> float:
        """The share of the hello interval after which the next hello is sent."""
        return 1.0

    def hello_start_ns(self, start_ns: int) -> int:
        """The earliest instant at which a hello, due at `start_ns`, may be sent."""
        return start_ns

    def send_hello(self, packet: Packet, *, start_ns: int, wants_status: bool, now_ns: int) -> int:
        """Transmit a hello of this node; returns the sequence number of the transmit request. Without `wants_status` a
        protocol may send the hello later, in a frame with other packets, and returns -1.
        """
        return self._port.transmit(packet.frame, BROADCAST, start_ns=start_ns, wants_status=wants_status)

    def first_hello_ns(self, earliest_ns: int, start_ns: int) -> int:
        """When the first hello is to be made: from `start_ns` on, which is at random in the first interval, or sooner
        if hellos cannot collide.
        """
        return self.hello_due_ns(start_ns)

    def hello_due_ns(self, start_ns: int) -> int:
        """The instant for which the node's next hello, due at `start_ns`, is to be made; asked once for each hello."""
        return start_ns

    def on_hello(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:  # noqa: B027
        """A neighbor's hello was received."""

    def on_impersonation(self, packet: Packet, *, now_ns: int) -> None:  # noqa: B027
        """A packet names this node as its origin, but another node has made it; it goes no further."""

    def on_copy(self, key: int, src: NodeId, *, now_ns: int) -> None:  # noqa: B027
        """Another copy of a packet (`duplicates.key_of`) was received from a neighbor, in a phase in which it was
        handled before.

        The protocol may cancel what it has planned. It must not plan anything sooner, because the node does not ask
        again.
        """

    def on_status(self, status: TxStatus, *, now_ns: int) -> None:  # noqa: B027
        """The radio reports how a transmission ended; it does so only for those that asked for a status."""

    def wake(self, now_ns: int) -> None:  # noqa: B027
        """The instant has come that `next_wake_ns` has named."""

    def next_wake_ns(self) -> int | None:
        """The instant at which the protocol is to be woken; None if only inputs concern it."""
        return None

    def most_packet_bytes(self, priority: int) -> int:
        """The length, header included, of the longest packet of an application that this protocol carries at a
        priority, whatever the state of the network. Nothing longer is handed to it; it stays the same for ever.
        """
        return self._port.scenario.radio.max_frame_bytes

    def waiting(self) -> int:
        """The number of packets that wait in the protocol."""
        return 0

    def bound_ns(self) -> int | None:
        """The delay within which all nodes to which a way leads have the next packet of this node; None if no bound is
        stated.
        """
        return None

    def bounds(self, priority: int) -> bool:
        """True if `bound_ns` may apply to packets of this priority."""
        return True

    def clusters(self) -> Mapping[NodeId, tuple[NodeId, ...]]:
        """The nodes of each cluster by its head, the head first, as far as this node knows; or empty."""
        return {}

    def parted(self, now_ns: int, *, without: Collection[int] = ()) -> Collection[NodeId]:
        """The nodes to which there was a way, and is none any more that avoids those in `without`, which are lost."""
        return ()

    def hold(self, nodes: Collection[NodeId]) -> None:  # noqa: B027
        """From now on the UAV flies so that these neighbors, and no others, stay in reach."""

    def lose_sight(self, ends_ns: Mapping[NodeId, int]) -> None:  # noqa: B027
        """From now on lines of sight to these neighbors, and to no others, are expected to end at these instants."""

    def least_interval_ns(self, deadline_ns: int) -> int | None:
        """The least interval between packets of this node that meets this deadline at all nodes, if it is known."""
        return None

    def report(self) -> Mapping[str, object]:
        """The state and the counters, as JSON values."""
        return {}
