"""Anti-entropy for schedules: whoever hears in a hello that a neighbor follows an older one sends it the newest again.

The leader floods its announcement once per flooding period; this carries it over links that floods miss: to those who
come back, and, with collision-free floods, to those for whom the old timetable no longer works. Copies are suppressed
as in Trickle (RFC 6206). Nothing is sent while all agree.
"""

from collections.abc import Callable
from typing import Final

from fanet_mw.node.duplicates import key_of
from fanet_mw.node.packet import Packet
from fanet_mw.routing.clustered.roles.lease import Authority
from fanet_mw.units import MS
from fanet_mw.wire.inner import Beacon

_FLOOD_OVER_NS: Final = 500 * MS
"""A flood that was heard is over everywhere after this."""
_ASSESS_NS: Final = 200 * MS
_AGAIN_NS: Final = 900 * MS


class Refresh:
    """The newest announcement at one node."""

    def __init__(self, random: Callable[[], float]) -> None:
        self._random = random
        self._version: tuple[Authority, int] | None = None
        self._packets: dict[int, Packet] = {}
        """By part."""
        self._kept_ns = 0
        self._due_ns: int | None = None

    def keep(self, packet: Packet, part: int, authority: Authority, epoch: int, *, now_ns: int) -> None:
        """An announcement that we obey, or our own."""
        if (authority, epoch) != self._version:
            self._version, self._packets = (authority, epoch), {}
            self._kept_ns = now_ns  # not at each repetition: with short periods there would be no time left in between
        self._packets[part] = packet

    def compare(self, beacon: Beacon, *, now_ns: int) -> None:
        """A neighbor said whom it follows."""
        if self._version is None or self._due_ns is not None or now_ns - self._kept_ns < _FLOOD_OVER_NS:
            return
        authority, epoch = self._version
        theirs = Authority(beacon.term, beacon.leader)
        behind = not beacon.leader or theirs > authority
        if behind or (theirs == authority and 0 < ((epoch - beacon.epoch) & 0xFFFF) < 0x8000):
            self._due_ns = now_ns + int(self._random() * _ASSESS_NS)

    def overheard(self, key: int, *, now_ns: int) -> None:
        """Somebody else sent it."""
        if self._due_ns is not None and any(key == _key(packet) for packet in self._packets.values()):
            self._due_ns, self._kept_ns = None, now_ns + _AGAIN_NS - _FLOOD_OVER_NS

    def next_wake_ns(self) -> int | None:
        return self._due_ns

    def due(self, *, now_ns: int) -> list[Packet]:
        """Packets to flood once more, now."""
        if self._due_ns is None or now_ns < self._due_ns:
            return []
        self._due_ns, self._kept_ns = None, now_ns + _AGAIN_NS - _FLOOD_OVER_NS
        return [self._packets[part] for part in sorted(self._packets)]


def _key(packet: Packet) -> int:
    return key_of(origin=packet.header.origin, seq=packet.header.seq)
