"""The contracts of the parts of the clustered protocol. `build.py` chooses a class for each by `clusters.relay`.

    Access       when this node transmits a packet that it is the first to flood, and what contends for the channel
    Relaying     whether and when this node passes on a flood that began elsewhere
    HearsCopies  parts that cancel a transmission when another node has made it

`Clustered` calls all of them, and the node's roles (`roles/assigned_roles.py`), which give a `ScheduledAccess` the
schedule; no other part knows any of its siblings.
"""

from collections.abc import Container, Mapping, Sequence
from typing import Protocol

from fanet_mw.bus.messages import Reception
from fanet_mw.node.packet import Packet, Relay
from fanet_mw.wire import Kind


class Access(Protocol):
    """The access of a node to the channel: when it transmits what it has to send."""

    def start(self, now_ns: int) -> None:
        """The node has started."""

    def admit(self, packet: Packet, *, due_ns: int) -> bool:
        """Admission control of an own application's packet, due at `due_ns`; False if the packet is refused."""

    def most_packet_bytes(self, priority: int) -> int:
        """The length of the longest packet of an application for which every slot or turn has room, at a priority."""

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        """Flood an own application's packet from here, or send it towards a node that will."""

    def forward(self, packet: Packet, *, start_ns: int, now_ns: int, tries: int = 0) -> None:
        """Flood a packet from here, or send it one hop towards a node that will; `tries`: how often already."""

    def flood_control(
        self, kind: Kind, inner: bytes, *, now_ns: int, urgent: bool = False, patient: bool = False
    ) -> Packet:
        """Flood a control packet to all nodes; without flags it contends for the channel.

        In a timetable, an `urgent` one goes in the node's next turn, and a `patient` one in a turn that is not needed
        for anything else.
        """

    def answer(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        """Send a packet again that a neighbor has missed, which was to be announced at `due_ns`."""

    def hello_due_ns(self, start_ns: int) -> int:
        """The instant for which the next hello, due at `start_ns`, is to be made; asked once for each hello."""

    def hello_start_ns(self, start_ns: int) -> int:
        """The earliest instant at which a hello, due at `start_ns`, may be transmitted."""

    def hello_until_ns(self, start_ns: int, size: int) -> int:
        """The instant from which a hello of `size` bytes may no longer begin that may at `start_ns`; 0: none."""

    def next_wake_ns(self) -> int | None: ...

    def wake(self, now_ns: int) -> None: ...

    def waiting(self) -> int:
        """The number of packets that wait here for their first transmission."""

    def report(self) -> Mapping[str, object]:
        """The state and the counters of the part, as JSON values."""


class ScheduledAccess(Access, Protocol):
    """An access whose slots or turns follow from the leader's schedule."""

    def serve(self, now_ns: int) -> None:
        """The node has become the head of its cluster, so it floods the packets that it holds from here."""

    def renew_slot(self) -> None:
        """The slot of this head may have another length or another guard time in the new schedule."""


class Relaying(Protocol):
    """Decides which floods that began elsewhere a node passes on."""

    def start(self, now_ns: int) -> None:
        """The node has started."""

    def on_flood(self, packet: Packet, reception: Reception, *, at_once: bool, now_ns: int) -> Sequence[Relay]:
        """The first copy of a flooded packet was received.

        Returns the relays that the node is to make of it, mostly one or none. `at_once`: every node must pass this
        packet on, and soon.
        """

    def report(self) -> Mapping[str, object]:
        """The state and the counters of the part, as JSON values."""


class HearsCopies(Protocol):
    """A part that plans to send packets, and cancels those that another node has sent in the meantime."""

    @property
    def pending(self) -> Container[int]:
        """The keys (`duplicates.key_of`) of the packets whose copies matter to it, always as the same object."""

    def on_copy(self, key: int, *, now_ns: int) -> None:
        """Another node has sent the packet with this key."""
