"""The leader's knowledge of all links, put together from what each node has reported about the links to it.

Both directions are taken to be equally good, so the mean of both measurements counts, or the only one there is. If one
end receives nothing, there is no link, but the sender may still disturb: the entry keeps its power, and gets a grade of
0. The share of a usable link is drawn towards the mean of all usable links (shrinkage), as it is known from few hellos.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Final

from fanet_mw.units import NodeId
from fanet_mw.wire.links import Link, grade_of

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
