"""The quality of a node's links, measured from hellos: the share that arrives, and their mean power.

    hellos heard of the last 24 intervals, over those that should have come  ->  (heard + 1/2) / (due + 1), mean RSSI

The estimate is that of Krichevsky and Trofimov: a link of which little is known counts as neither good nor bad. What is
measured goes to the leader with a join: at first when some hellos should have come, then when a link has changed.
Not modeled: that a hello may be lost by a collision and not by the link; it then counts as loss all the same.
"""

from collections import deque
from collections.abc import Sequence
from math import fsum
from typing import Final

from fanet_mw.units import NodeId
from fanet_mw.wire.links import CAPACITY, MESSAGES, Link, grade_of, power_of

WINDOW: Final = 24
"""The length of the window, in hello intervals."""
FIRST: Final = 8
"""Hello intervals after the start for the first estimate."""
FAST: Final = 3
"""Hellos per interval until then, so that the estimate is one."""
_STEADY_HELLOS: Final = 4
_STEADY_DB: Final = 1.0
STEADY: Final = 0.995
"""Taken for the share of a link whose power did not vary by more than that over so many hellos, and half of those that
were due: what such a link loses it loses to collisions, and there are none in turns."""
_CHANGED: Final = 0.3
"""A share that differs by this much from what was told is news."""


class LinkQuality:
    """The links of one node as its neighbors' hellos show them."""

    def __init__(self, node: NodeId, *, hello_ns: int) -> None:
        self._node = node
        self._hello_ns = hello_ns
        self._start_ns = 0
        self._heard: dict[NodeId, deque[tuple[int, float]]] = {}
        """(instant of arrival, RSSI) of the hellos of each neighbor within the window."""
        self._told: dict[NodeId, float] = {}

    def hello_share(self, *, now_ns: int) -> float:
        """After which part of the hello interval the next hello should go."""
        return 1.0 if self.has_estimate(now_ns=now_ns) else 1 / FAST

    def start(self, now_ns: int) -> None:
        """The node is up."""
        self._start_ns = now_ns

    def on_hello(self, neighbor: NodeId, *, rssi_dbm: float, now_ns: int) -> None:
        """Note a neighbor's hello."""
        self._heard.setdefault(neighbor, deque()).append((now_ns, rssi_dbm))

    def links(self, *, now_ns: int) -> tuple[Link, ...]:
        """The links from each neighbor to this node, by id; the best ones if there are more than one message holds."""
        horizon_ns = now_ns - WINDOW * self._hello_ns
        found = []
        for neighbor in sorted(self._heard):
            heard = self._heard[neighbor]
            while heard and heard[0][0] < horizon_ns:
                heard.popleft()
            if not heard:
                del self._heard[neighbor]
                continue
            power = fsum(rssi_dbm for _, rssi_dbm in heard) / len(heard)
            found.append(Link(neighbor, self._node, grade_of(self._chance(heard, now_ns)), power_of(power)))
        best = sorted(found, key=lambda link: (-link.grade, link.a))[: CAPACITY * MESSAGES]
        return tuple(sorted(best))

    def _chance(self, heard: Sequence[tuple[int, float]], now_ns: int) -> float:
        since_ns = max(self._start_ns, now_ns - WINDOW * self._hello_ns)
        fast_ns = max(0, min(now_ns, self._start_ns + FIRST * self._hello_ns) - since_ns)
        due = (now_ns - since_ns + (FAST - 1) * fast_ns) // self._hello_ns
        powers = [rssi_dbm for _, rssi_dbm in heard]
        if len(heard) >= max(_STEADY_HELLOS, due / 2) and max(powers) - min(powers) <= _STEADY_DB:
            return STEADY
        return (len(heard) + 0.5) / (max(due, len(heard)) + 1)

    def has_estimate(self, *, now_ns: int) -> bool:
        """True as soon as some hellos of each neighbor should have come."""
        return now_ns - self._start_ns >= FIRST * self._hello_ns

    def tell(self, *, now_ns: int) -> tuple[Link, ...]:
        """The links for a join; none before there is an estimate."""
        if not self.has_estimate(now_ns=now_ns):
            return ()
        links = self.links(now_ns=now_ns)
        self._told = {link.a: link.chance for link in links}
        return links

    def outdated(self, *, now_ns: int) -> bool:
        """True if the leader should be told: there is a first estimate, or a link has changed."""
        if not self.has_estimate(now_ns=now_ns):
            return False
        now = {link.a: link.chance for link in self.links(now_ns=now_ns)}
        return any(abs(now.get(node, 0.0) - self._told.get(node, 0.0)) > _CHANGED for node in now.keys() | self._told)
