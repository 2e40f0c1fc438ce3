"""What both schedulers of floods share: the geometry, the order in which floods begin, and how far a flood can go.

    list_scheduling.py         links that lose nothing: every node sends a packet at most once
    redundant_scheduling.py    links that lose frames: a frame is repeated until it is likely heard

Sets of nodes are the bits of integers, by the nodes' row numbers.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple, Protocol, TypeVar

from fanet_mw.units import NodeId

RECEIVER: Final = 100
"""What it is worth that one more node gets a packet, or all the copies that it needs, in turns of its flood's age."""
ONLY: Final = 50
"""What it is worth besides that no other holder of the packet could have served that node."""
WINDOW: Final = 24
"""The number of floods that are under way at once. More of them cost computing time and gain little."""


class Geometry(NamedTuple):
    """The geometry for which a timetable is computed."""

    link_m: float
    """Nodes that are no farther apart hear each other."""
    interference_m: float
    """A transmitter that is no farther from a receiver destroys what the receiver hears."""
    turns: int
    """The number of turns of one superframe."""
    hop_turns: int
    """The number of turns from the one that brings a packet to the first that can relay it; 1: the next turn can."""


class NodeRows:
    """The nodes of a swarm, and the row number of each."""

    def __init__(self, nodes: Iterable[NodeId]) -> None:
        self.ids = tuple(nodes)
        self.row = {node: row for row, node in enumerate(self.ids)}
        self.everyone = (1 << len(self.ids)) - 1
        """The rows of all of them, as a bit set."""

    def of(self, bits: int) -> tuple[NodeId, ...]:
        """The nodes of a bit set, in the order of their rows."""
        return tuple(self.ids[row] for row in rows(bits))


class Placed(Protocol):
    """A flood, as far as a scheduler has placed it."""

    sent: list[tuple[int, int]]
    """The transmissions of this flood as (offset, row), in order."""


def age(flood: Placed, offset: int) -> int:
    """The number of turns since a flood began; 0 for one that has not begun."""
    return offset - flood.sent[0][0] if flood.sent else 0


AnyFlood = TypeVar("AnyFlood", bound=Placed)


def turn_by_turn(
    floods: Sequence[AnyFlood], *, turns: int, window: int, pace: float
) -> Iterator[tuple[int, int, dict[int, AnyFlood]]]:
    """Each turn until all floods have been placed: its offset, how many floods have begun, and those under way.

    Who asks for the turns fills them, and takes the floods that are done out of those under way. Floods begin evenly
    over this share (`pace`) of so many `turns`, and no more than a `window` of them are under way.
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
    """The rows that a flood of this row can reach, itself included, and the number of hops that it takes."""
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
