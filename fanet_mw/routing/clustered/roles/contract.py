"""What the roles ask of a timetable: what the leader adds to its schedule, and who reads it."""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from fanet_mw.node.packet import Packet
from fanet_mw.routing.clustered.roles.leader import Leader
from fanet_mw.units import NodeId
from fanet_mw.wire.loads import Loads
from fanet_mw.wire.places import Places
from fanet_mw.wire.schedule import Schedule


class PartDetails(NamedTuple):
    """What comes with a part of a schedule: the positions of its members, and their loads if the leader hears them."""

    places: Places
    loads: Loads | None = None


class Timetabling(Protocol):
    """What the leader adds to its schedule, and the timetable that nodes compute from both."""

    needs_every_link: bool
    """True if a silent node or a lost link cuts others off, so that the leader must be told and plan anew."""

    def addition(self, part: Schedule, leader: Leader) -> bytes:
        """The inner frames that the leader adds to a part of the schedule."""

    def links_to_send_after(self, part: Schedule, leader: Leader) -> list[bytes]:
        """The inner frames of the packets with links that follow a part of the schedule."""

    def read(self, packet: Packet, schedule: Schedule) -> PartDetails | None:
        """The positions and loads that came with a part of a schedule; raises MalformedFrameError."""

    def on_schedule(self, packet: Packet, schedule: Schedule, details: PartDetails | None, *, now_ns: int) -> None:
        """A part of a schedule was received, and the roles have accepted it."""

    def on_links(self, packet: Packet, *, now_ns: int) -> None:
        """A packet of links was received that belongs to a schedule; raises MalformedFrameError."""

    def review(self, now_ns: int) -> None:
        """A hello is due: give the timetable up if this node hears nobody keep it."""

    def must_show(self, now_ns: int) -> bool:
        """True if a flood of this node in its turn is to show the others that it keeps the timetable."""

    def on_called_silent(self, node: NodeId, now_ns: int) -> None:
        """It was told to all that a node, perhaps this one, is silent or hears nobody."""

    def notice_ns(self, now_ns: int) -> int:
        """How long ahead the leader must announce another schedule."""

    def lost_ns(self, now_ns: int) -> Mapping[NodeId, int]:
        """The silence after which those nodes are lost that were not heard in their turns for so long."""


class NoTimetable:
    """Schedules without a timetable: they only say who heads which cluster, and which slot it has."""

    needs_every_link = False

    def addition(self, part: Schedule, leader: Leader) -> bytes:
        return b""

    def links_to_send_after(self, part: Schedule, leader: Leader) -> list[bytes]:
        return []

    def read(self, packet: Packet, schedule: Schedule) -> PartDetails | None:
        return None

    def on_schedule(self, packet: Packet, schedule: Schedule, details: PartDetails | None, *, now_ns: int) -> None: ...

    def on_links(self, packet: Packet, *, now_ns: int) -> None: ...

    def review(self, now_ns: int) -> None: ...

    def must_show(self, now_ns: int) -> bool:
        return False

    def on_called_silent(self, node: NodeId, now_ns: int) -> None: ...

    def notice_ns(self, now_ns: int) -> int:
        return 0

    def lost_ns(self, now_ns: int) -> Mapping[NodeId, int]:
        return {}
