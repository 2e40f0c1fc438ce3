"""Parts that both schedulers of floods share: the geometry, how many floods may begin at a time, and their reach.

    list_scheduling.py         for links without losses: every node sends a packet at most once
    redundant_scheduling.py    for lossy links: a frame is repeated until it has likely arrived

Sets of nodes are represented as the bits of integers, by the nodes' row numbers.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple, Protocol, TypeVar

from fanet_mw.units import NodeId

RECEIVER: Final = 100
"""The worth of serving one more node, with all the copies that it needs, in units of turns of the flood's age."""
ONLY: Final = 50
"""The additional worth if no other holder of the packet could serve that node."""
WINDOW: Final = 24
"""The greatest number of floods under way at once. More would cost computing time and gain little."""


class Geometry(NamedTuple):
    """The geometry for which a timetable is computed."""

    link_m: float
    """The greatest distance at which nodes receive each other."""
    interference_m: float
    """The greatest distance at which a sender disturbs a receiver of another frame."""
    turns: int
    """The number of turns in a superframe."""
    hop_turns: int
    """The turns from the one in which a packet arrives to the first that can relay it; 1: the next turn."""
    margin_m: float = 0.0
    """By so much shorter links are preferred, because positions have errors; the others are used where nodes would be
    cut off without them."""


class NodeRows:
    """The nodes of a swarm, and the row number of each."""

    def __init__(self, nodes: Iterable[NodeId]) -> None:
        self.ids = tuple(nodes)
        self.row = {node: row for row, node in enumerate(self.ids)}
        self.everyone = (1 << len(self.ids)) - 1

    def of(self, bits: int) -> tuple[NodeId, ...]:
        """The nodes of a bit set, in the order of their rows."""
        return tuple(self.ids[row] for row in rows(bits))


class Placed(Protocol):
    """A flood, as far as a scheduler has scheduled it."""

    sent: list[tuple[int, int]]
    """The transmissions of this flood as (offset, row), in order."""


def age(flood: Placed, offset: int) -> int:
    """The number of turns since a flood began; 0 if it has not begun."""
    return offset - flood.sent[0][0] if flood.sent else 0


AnyFlood = TypeVar("AnyFlood", bound=Placed)


def turn_by_turn(
    floods: Sequence[AnyFlood], *, turns: int, window: int, pace: float
) -> Iterator[tuple[int, int, dict[int, AnyFlood]]]:
    """The turns until all floods are scheduled: offset, how many have begun, and those under way, from which the caller
    removes completed ones. They begin evenly over the share `pace` of `turns`, at most `window` at once.
    """
    count, begun, offset = len(floods), 0, 0
    under_way: dict[int, AnyFlood] = {}
    while begun < count or under_way:
        while begun < count and len(under_way) < window and offset * count >= int(begun * turns * pace):
            under_way[begun] = floods[begun]
            begun += 1
        yield offset, begun, under_way
        offset += 1


def reach(hears: Sequence[int], root: int) -> tuple[int, int]:
    """The rows that a flood from this row can reach, itself included, and the number of hops to the farthest."""
    found = frontier = 1 << root
    hops = -1
    while frontier:
        hops += 1
        near = 0
        for row in rows(frontier):
            near |= hears[row]
        frontier = near & ~found
        found |= near
    return found, hops


def rows(bits: int) -> list[int]:
    """The rows of a bit set, ascending."""
    found = []
    while bits:
        low = bits & -bits
        found.append(low.bit_length() - 1)
        bits ^= low
    return found
