"""What the parts of the clustered protocol promise each other. `build.py` chooses one of each by `clusters.relay`.

    Clustered  ->  Roles       which node leads, heads a cluster, is a member
               ->  Access      when a packet that is to be flooded from here goes on the air, and what contends
               ->  Relaying    whether and when a flood that began elsewhere is passed on
               ->  TwoHops     what hellos say of the nodes within two hops, where a rule needs it
               ->  HearsCopies parts that call off what they plan when another node has sent it

Roles tell an access what a schedule has made of the node; no other part knows of any beside it. Instants are handed in.
"""

from collections.abc import Container, Mapping, Sequence
from typing import Protocol

from fanet_mw.bus.messages import Reception
from fanet_mw.node.neighbors import Neighbor
from fanet_mw.node.packet import Packet, Relay
from fanet_mw.routing.clustered.forwarding.gradient import RouteToHead
from fanet_mw.units import NodeId
from fanet_mw.wire import Kind
from fanet_mw.wire.claims import Claims
from fanet_mw.wire.inner import Beacon


class Roles(Protocol):
    """What a node is in its swarm, and how that changes."""

    def start(self, now_ns: int) -> None:
        """The node is up."""

    def on_sign_of_life(self, node: int, *, born_ns: int, now_ns: int) -> None:
        """A packet came in that a node generated at `born_ns`."""

    def on_control(self, packet: Packet, src: NodeId, *, now_ns: int) -> bool:
        """A flooded packet that is no data, which `src` transmitted; True: every node passes it on at once.

        Raises MalformedFrameError for what no node of this swarm sends.
        """

    def on_hello(self, neighbor: Neighbor, *, born_ns: int, now_ns: int) -> None:
        """A neighbor's hello, which it generated at `born_ns`."""

    def on_impersonation(self, packet: Packet, *, now_ns: int) -> None:
        """Take in a packet that another node sent in the name of this one."""

    def on_flooding(self, due_ns: int) -> None:
        """The node's application has a packet flooded to everyone from an instant on."""

    def on_parent_lost(self, parent: NodeId, *, now_ns: int) -> None:
        """The MAC could not reach this neighbor, which was the way to a head."""

    def before_hello(self, now_ns: int) -> None:
        """The node is about to say hello: what goes with the hellos' rhythm is done now."""

    def beacon(self, route: RouteToHead | None, *, now_ns: int) -> Beacon:
        """What the hello says of the node's role, and of its route to a head."""

    def hello_share(self, now_ns: int) -> float:
        """After which part of the hello interval the next hello should go."""

    def next_wake_ns(self) -> int | None: ...

    def wake(self, now_ns: int) -> None: ...

    def clusters(self) -> Mapping[NodeId, tuple[NodeId, ...]]:
        """The nodes of each cluster by head, the head first, as far as the node knows."""

    def report(self) -> Mapping[str, object]:
        """JSON-able state."""


class Access(Protocol):
    """The access of a node to the air: when what it has to send goes out."""

    def start(self, now_ns: int) -> None:
        """The node is up."""

    def admit(self, packet: Packet, *, due_ns: int) -> bool:
        """Let in a packet of the node's application, due at `due_ns`; False if it is refused."""

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        """Let out a packet of the node's application, or bring it to a node that will."""

    def forward(self, packet: Packet, *, start_ns: int, now_ns: int, tries: int = 0) -> None:
        """Let a packet out here, or bring it one step nearer to a node that will; `tries` were made here before."""

    def flood_control(
        self, kind: Kind, inner: bytes, *, now_ns: int, urgent: bool = False, patient: bool = False
    ) -> Packet:
        """Tell everyone, where there are turns: `urgent`, in one of them; `patient`, in one that nothing else needs."""

    def answer(self, packet: Packet, *, now_ns: int) -> None:
        """Send what a neighbor lacks."""

    def hello_start_ns(self, start_ns: int, *, size: int) -> int:
        """The instant from which a hello of about so many bytes may go that is due at `start_ns`."""

    def next_wake_ns(self) -> int | None: ...

    def wake(self, now_ns: int) -> None: ...

    def waiting(self) -> int:
        """Packets that wait here to be let out."""

    def report(self) -> Mapping[str, object]:
        """JSON-able state."""


class ScheduledAccess(Access, Protocol):
    """An access whose slots or turns follow from the leader's schedule."""

    def serve(self, now_ns: int) -> None:
        """The node has become head of its cluster: what it holds is let out here."""

    def renew_slot(self) -> None:
        """The schedule may have given the slot of this head another length, or another guard time."""


class Relaying(Protocol):
    """Which floods that began elsewhere a node passes on."""

    def start(self, now_ns: int) -> None:
        """The node is up."""

    def on_flood(self, packet: Packet, reception: Reception, *, at_once: bool, now_ns: int) -> Sequence[Relay]:
        """The first copy of a flooded packet; returned is when the node passes it on, mostly once or never. `at_once`:
        every node passes it on, and soon.
        """

    def report(self) -> Mapping[str, object]:
        """JSON-able state."""


class TwoHops(Protocol):
    """What hellos say of the nodes within two hops."""

    def claims(self, now_ns: int) -> Claims:
        """What the node's next hello says; asked once per hello, before anything else is written into it."""

    def on_claims(self, claims: Claims, beacon: Beacon, *, now_ns: int) -> None:
        """What a neighbor's hello says of its neighbors and itself."""


class HearsCopies(Protocol):
    """A part that plans to send packets, and gives up those that another node has sent meanwhile."""

    @property
    def pending(self) -> Container[int]:
        """The keys (`duplicates.key_of`) of the packets whose copies matter to it: one object for good."""

    def on_copy(self, key: int, *, now_ns: int) -> None:
        """Take in that another node has sent such a packet."""
