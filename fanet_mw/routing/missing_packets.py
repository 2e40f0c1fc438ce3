"""The data packets that a node knows to lack: those that neighbors say to have, and gaps in an origin's numbers.

A packet counts as missing when its flood should be over, and is given up after a while. Who lacks nothing states what
it has in every fourth hello, so that a node hears of packets that it never receives.
"""

from collections.abc import Iterable
from typing import Final

from fanet_mw.wire.hello.digest import WINDOW

_MASK: Final = 0xFFFF_FFFF
_HALF: Final = 1 << 31
_EVERY_HELLOS: Final = 4


class MissingPackets:
    """The packets that one node lacks."""

    def __init__(self, *, patience_ns: int, window_ns: int) -> None:
        """`patience_ns`: how long a packet may be under way. `window_ns`: how long it is missed."""
        self._patience_ns = patience_ns
        self._window_ns = window_ns
        self._silent = 0
        """The number of hellos since the last one that stated what this node has."""
        self._newest: dict[int, int] = {}
        self._noticed_ns: dict[tuple[int, int], int] = {}
        """When each packet was noticed, by origin and number; those given up stay until nobody speaks of them."""
        self._until_ns = 0
        """The instant until which losses are suspected, whatever is missing."""

    def receive(self, origin: int, seq: int, *, now_ns: int) -> None:
        noticed, newest = self._noticed_ns, self._newest.get(origin, seq)
        if noticed:
            noticed.pop((origin, seq), None)
        ahead = (seq - newest) & _MASK
        if ahead >= _HALF:
            return
        self._newest[origin] = seq
        if 1 < ahead < WINDOW:
            self.notice(((origin, (newest + skipped) & _MASK) for skipped in range(1, ahead)), now_ns=now_ns)
        if noticed:
            for packet in [one for one in noticed if one[0] == origin and WINDOW <= (seq - one[1]) & _MASK < _HALF]:
                del noticed[packet]

    def notice(self, packets: Iterable[tuple[int, int]], *, now_ns: int) -> None:
        """Packets that this node does not have were sent, by origin and number."""
        for packet in packets:
            self._noticed_ns.setdefault(packet, now_ns)

    def suspect(self, now_ns: int) -> None:
        """Something has shown that frames get lost, although this node may have received all."""
        self._until_ns = now_ns + self._window_ns

    def any(self, *, now_ns: int) -> bool:
        """True if a packet is missing, or others may miss some."""
        oldest_ns, overdue_ns = now_ns - self._window_ns, now_ns - self._patience_ns
        return now_ns < self._until_ns or any(oldest_ns <= at_ns <= overdue_ns for at_ns in self._noticed_ns.values())

    def states(self, *, now_ns: int) -> bool:
        """True if the hello that is made now is to state what this node has."""
        self._silent += 1
        if self._silent < _EVERY_HELLOS and not self.any(now_ns=now_ns):
            return False
        self._silent = 0
        return True
