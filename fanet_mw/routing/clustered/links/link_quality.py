"""Measures the quality of a node's links from the hellos of its neighbors: the share of hellos received, and their mean
RSSI.

    estimated share = (received + 1/2) / (due + 1), for the hellos of the latest 24 intervals    (Krichevsky, Trofimov)

The leader knows all links (`LinkState`) from what nodes report. Both directions are taken to be equally good; if one
end receives nothing, there is no link, but the sender may still disturb: the entry keeps its power, and gets a grade of
0. Shares are drawn towards the mean of all usable links (shrinkage). Not modeled: hellos lost by collisions count
alike.
"""

from collections import deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from math import fsum
from typing import Final

from fanet_mw.units import NodeId
from fanet_mw.wire.links import CAPACITY, MESSAGES, Link, grade_of, power_of

WINDOW: Final = 24
"""The length of the measurement window, in hello intervals."""
FIRST: Final = 8
"""The number of hello intervals from the start to the first estimate."""
FAST: Final = 3
"""The number of hellos that a node sends per interval until then, so that the first estimate is accurate enough."""
_STEADY_HELLOS: Final = 4
_STEADY_DB: Final = 1.0
STEADY: Final = 0.995
"""The share that is assumed for a steady link: one whose RSSI varied by at most `_STEADY_DB` over many hellos, at least
half of those that were due. Its losses must be collisions, and there are none in turns."""
_CHANGED: Final = 0.3
"""A link has changed if its share differs by at least this much from what the leader was told."""


class LinkQuality:
    """The links from all neighbors to one node, measured by the neighbors' hellos."""

    def __init__(self, node: NodeId, *, hello_ns: int) -> None:
        self._node = node
        self._hello_ns = hello_ns
        self._start_ns = 0
        self._heard: dict[NodeId, deque[tuple[int, float]]] = {}
        """For each neighbor, the instant of arrival and the RSSI of each hello in the window."""
        self._told: dict[NodeId, float] = {}

    def hello_share(self, *, now_ns: int) -> float:
        return 1.0 if self.has_estimate(now_ns=now_ns) else 1 / FAST

    def start(self, now_ns: int) -> None:
        self._start_ns = now_ns

    def on_hello(self, neighbor: NodeId, *, rssi_dbm: float, now_ns: int) -> None:
        self._heard.setdefault(neighbor, deque()).append((now_ns, rssi_dbm))

    def links(self, *, now_ns: int) -> tuple[Link, ...]:
        """The links from each neighbor to this node, by id; only the best ones if a message cannot hold all."""
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
        return now_ns - self._start_ns >= FIRST * self._hello_ns

    def tell(self, *, now_ns: int) -> tuple[Link, ...]:
        """The links for a join; none as long as there is no estimate."""
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


USABLE: Final = 0.5
"""Links over which at least this share of frames arrives are used to form clusters."""
_STEADY: Final = 0.99
_OWN: Final = 0.3
"""The weight of a link's own measurement; the rest of the weight is that of the mean of all links."""
_CHANGE: Final = 0.1
"""A new timetable is made when the shares of all links together have changed by this part of their sum."""


class LinkState:
    """The newest report of each node about its links."""

    def __init__(self) -> None:
        self._told: dict[NodeId, dict[NodeId, Link]] = {}

    def on_report(self, node: NodeId, links: Iterable[Link]) -> None:
        """A node has reported how well it receives its neighbors. Only the receiver of a link can report it."""
        self._told[node] = {link.a: link for link in links if link.b == node}

    def known(self, nodes: Collection[NodeId]) -> int:
        return sum(1 for node in nodes if node in self._told)

    def between(self, nodes: Collection[NodeId]) -> tuple[Link, ...]:
        """The links among these nodes, one for each pair, ascending."""
        here = frozenset(nodes)
        pairs = {
            (min(a, b), max(a, b)) for b in here & self._told.keys() for a in self._told[b] if a in here and a != b
        }
        return _shrunk([self._pair(a, b) for a, b in sorted(pairs)])

    def _pair(self, a: NodeId, b: NodeId) -> Link:
        ways = [self._told[to].get(by) for by, to in ((a, b), (b, a)) if to in self._told]
        known = [link for link in ways if link is not None]
        chance = sum(link.chance for link in known) / len(known)
        grade = grade_of(chance) if len(known) == len(ways) else 0
        return Link(a, b, grade, max(link.power_dbm for link in known))


def _shrunk(links: Sequence[Link]) -> tuple[Link, ...]:
    """The links with the shares of usable ones drawn towards their mean; steady links stay as they are."""
    usable = [link.chance for link in links if USABLE <= link.chance < _STEADY]
    mean = sum(usable) / max(1, len(usable))
    return tuple(
        link._replace(grade=grade_of(_OWN * link.chance + (1 - _OWN) * mean))
        if USABLE <= link.chance < _STEADY
        else link
        for link in links
    )


def adjacency(links: Sequence[Link], nodes: Iterable[NodeId]) -> dict[NodeId, tuple[NodeId, ...]]:
    """The neighbors of each node over links that are good enough."""
    found: dict[NodeId, list[NodeId]] = {node: [] for node in sorted(nodes)}
    for link in links:
        if link.chance >= USABLE and link.a in found and link.b in found:
            found[link.a].append(link.b)
            found[link.b].append(link.a)
    return {node: tuple(sorted(near)) for node, near in found.items()}


def worth_a_change(before: Sequence[Link], now: Sequence[Link]) -> bool:
    """True if the links have changed so much that the timetable made for the earlier ones should be replaced."""
    chances: Mapping[tuple[NodeId, NodeId], float] = {(link.a, link.b): link.chance for link in before}
    later = {(link.a, link.b): link.chance for link in now}
    pairs = sorted(chances.keys() | later.keys())
    apart = sum(abs(chances.get(pair, 0.0) - later.get(pair, 0.0)) for pair in pairs)
    return apart > _CHANGE * max(1.0, sum(later.values()))
