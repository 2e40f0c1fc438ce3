"""Anti-entropy for schedules: a node that learns that a neighbor follows an older schedule sends it the newest again.

The leader floods its announcement once per flooding period; this carries it over links that floods miss: to nodes that
come back and, with collision-free floods, to nodes for which the old timetable no longer works. Copies are suppressed
as in Trickle (RFC 6206). While all nodes agree, nothing is sent.
"""

from collections.abc import Callable

from fanet_mw.node.duplicates import key_of_packet
from fanet_mw.node.packet import Packet
from fanet_mw.routing.clustered.forwarding.repair import AGAIN_NS, ASSESS_NS, FLOOD_OVER_NS
from fanet_mw.routing.clustered.roles.lease import Authority
from fanet_mw.wire.inner import Beacon


class ScheduleRefresh:
    """The newest announcement at one node, and when to send it again."""

    def __init__(self, random: Callable[[], float]) -> None:
        self._random = random
        self._version: tuple[Authority, int] | None = None
        self._packets: dict[int, Packet] = {}
        """The packets of the announcement, by part."""
        self._kept_ns = 0
        self.due_ns: int | None = None
        """The instant at which it is to be sent again; None: never."""
        self.pending: set[int] = set()
        """The keys of the packets that are to be sent again; a copy of another packet changes nothing here."""

    def keep(self, packet: Packet, part: int, authority: Authority, epoch: int, *, now_ns: int) -> None:
        """Keep an announcement that this node follows, or its own."""
        if (authority, epoch) != self._version:
            self._version, self._packets = (authority, epoch), {}
            self._kept_ns = now_ns  # not at each repetition, which with short periods would leave no time in between
        self._packets[part] = packet
        self._plan(self.due_ns)

    def on_beacon(self, beacon: Beacon, *, now_ns: int) -> None:
        """Compare the schedule that a neighbor follows, as its beacon states."""
        if self._version is None or self.due_ns is not None or now_ns - self._kept_ns < FLOOD_OVER_NS:
            return
        authority, epoch = self._version
        theirs = Authority(beacon.term, beacon.leader)
        behind = not beacon.leader or theirs > authority
        if behind or (theirs == authority and 0 < ((epoch - beacon.epoch) & 0xFFFF) < 0x8000):
            self._plan(now_ns + int(self._random() * ASSESS_NS))

    def _plan(self, due_ns: int | None) -> None:
        """Send all packets of the announcement at this instant; None: do not send them."""
        self.due_ns = due_ns
        self.pending.clear()
        if due_ns is not None:
            self.pending.update(map(key_of_packet, self._packets.values()))

    def on_copy(self, key: int, *, now_ns: int) -> None:
        """Note that another node has sent the announcement again."""
        if key in self.pending:
            self._over(now_ns)

    def due(self, *, now_ns: int) -> list[Packet]:
        """The packets to flood once more now."""
        if self.due_ns is None or now_ns < self.due_ns:
            return []
        self._over(now_ns)
        return [self._packets[part] for part in sorted(self._packets)]

    def _over(self, now_ns: int) -> None:
        """Give the flood that another node or this one has begun time to come to its end."""
        self._plan(None)
        self._kept_ns = now_ns + AGAIN_NS - FLOOD_OVER_NS
