"""Collision-free floods: which node sends whose packet in which turn of the superframe. A pure function of positions.

    superframe:  | contention window | turn 0 | turn 1 | ... | turn N-1 |
    flood of h:    h in its root turn, then relays of a tree that covers everyone, each in a turn of its own

Two nodes share a turn only if no receiver of one is within interference range of the other (the protocol model of
Gupta and Kumar, 2000; for equal ranges: they are three hops apart). Floods follow each other through the swarm like
waves, as in Djukic and Valaee (ToN 17(3), 2009): the order of turns along the tree lets a packet cross the whole swarm
in one superframe. Every node computes the same table from the same positions; nothing else is agreed upon.

Not modeled: links that positions do not tell (obstacles); use a shorter `link_m` for a margin.
"""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

from fanet_mw.units import Enu, NodeId


class Geometry(NamedTuple):
    """What a table is computed for."""

    link_m: float
    """Nodes no farther apart hear each other."""
    interference_m: float
    """A transmitter no farther from a receiver destroys what that receives."""
    turns: int
    """Turns of one superframe."""
    hop_turns: int
    """Turns from hearing a packet to the first in which it can be relayed (1: the next)."""


class Turn(NamedTuple):
    """One transmission: `node` sends the packet that `root` let out as its `instance`-th of this superframe."""

    offset: int
    """Turns from the beginning of the root's superframe; may reach into the next one."""
    node: NodeId
    root: NodeId
    instance: int


class Timetable(NamedTuple):
    """All turns of a superframe."""

    turns: tuple[Turn, ...]
    spans: Mapping[NodeId, int]
    """Per root: turns from its own until everyone has its packet, the first and the last included."""
    uncovered: Mapping[NodeId, tuple[NodeId, ...]]
    """Per root: nodes that it cannot reach at all: the swarm is in parts."""
    used: int
    """Turns that are in use, of `geometry.turns`."""

    def roots(self) -> list[Turn]:
        """The turns in which packets are let out."""
        return [turn for turn in self.turns if turn.node == turn.root]


@lru_cache(maxsize=16)
def timetable(
    positions: tuple[tuple[NodeId, Enu], ...], roots: tuple[NodeId, ...], geometry: Geometry
) -> Timetable | None:
    """The table, None when the turns do not suffice. `roots`: one entry per packet and superframe, in any order.

    `positions` [m] in ascending order of nodes.
    """
    swarm = _Swarm(positions, geometry)
    plan = _Plan(swarm, geometry)
    for root in _by_place(roots, dict(positions)):
        if not plan.flood(root):
            return None
    return plan.table()


def _by_place(roots: Sequence[NodeId], positions: Mapping[NodeId, Enu]) -> list[NodeId]:
    """Waves that start far from each other can be in the air together: roots by turns from the near and far side."""
    ordered = sorted(roots, key=lambda node: (positions[node].east, positions[node].north, node))
    half = (len(ordered) + 1) // 2
    near, far = ordered[:half], ordered[half:]
    return [node for pair in zip(near, [*far, None], strict=False) for node in pair if node is not None]


class _Swarm:
    """Who hears and who disturbs whom, as bit sets over row numbers."""

    def __init__(self, positions: Sequence[tuple[NodeId, Enu]], geometry: Geometry) -> None:
        self.nodes = [node for node, _ in positions]
        self.row = {node: row for row, node in enumerate(self.nodes)}
        at = [place for _, place in positions]
        self.hears = [_within(at, row, geometry.link_m) for row in range(len(at))]
        reach = max(geometry.interference_m, geometry.link_m)
        disturbs = [_within(at, row, reach) for row in range(len(at))]
        self.conflicts = [self._conflicts(row, disturbs) for row in range(len(at))]

    def _conflicts(self, row: int, disturbs: Sequence[int]) -> int:
        """Rows that cannot send while this one does: themselves, and whoever spoils a reception of either."""
        found = 1 << row | disturbs[row]
        for other in range(len(disturbs)):
            if disturbs[row] & self.hears[other] or disturbs[other] & self.hears[row]:
                found |= 1 << other
        return found


def _within(at: Sequence[Enu], row: int, reach_m: float) -> int:
    here = at[row]
    return sum(
        1 << other
        for other, there in enumerate(at)
        if other != row and math.dist((here.east, here.north, here.up), (there.east, there.north, there.up)) <= reach_m
    )


class _Plan:
    """Places one flood after the other."""

    def __init__(self, swarm: _Swarm, geometry: Geometry) -> None:
        self._swarm = swarm
        self._geometry = geometry
        self._sending = [0] * geometry.turns
        """Who sends in each turn, as a bit set."""
        self._turns: list[Turn] = []
        self._spans: dict[NodeId, int] = {}
        self._uncovered: dict[NodeId, tuple[NodeId, ...]] = {}
        self._instances: dict[NodeId, int] = {}
        self._from = 0

    def flood(self, root: NodeId) -> bool:
        """Find turns for a packet of `root` and all its relays; False when there are not enough."""
        rows = self._tree(self._swarm.row[root])
        instance = self._instances.get(root, 0)
        starts: dict[int, int] = {}
        for row, parent in rows:
            earliest = self._from if parent is None else starts[parent] + self._geometry.hop_turns
            offset = self._free(row, earliest)
            if offset is None or (parent is None and offset >= self._geometry.turns):
                return False
            starts[row] = offset
            self._sending[offset % self._geometry.turns] |= 1 << row
            self._turns.append(Turn(offset, self._swarm.nodes[row], root, instance))
        first = starts[rows[0][0]]
        self._from = first
        self._instances[root] = instance + 1
        self._spans[root] = max(self._spans.get(root, 0), max(starts.values()) - first + 1)
        return True

    def _free(self, row: int, earliest: int) -> int | None:
        """The first turn from `earliest` on, within one superframe, in which this row disturbs nobody."""
        conflicts, turns, sending = self._swarm.conflicts[row], self._geometry.turns, self._sending
        for offset in range(earliest, earliest + turns):
            if not sending[offset % turns] & conflicts:
                return offset
        return None

    def _tree(self, root: int) -> list[tuple[int, int | None]]:
        """Relays that together reach everyone, level by level, each with the one it hears the packet from.

        In each level those first that reach most of what is not reached yet (the greedy set cover of RFC 3626, 8.3.1).
        """
        hears = self._swarm.hears
        relays: list[tuple[int, int | None]] = [(root, None)]
        reached = 1 << root | hears[root]
        level = dict.fromkeys(_rows(hears[root]), root)
        while level:
            following: dict[int, int] = {}
            while True:
                row = max(level, key=lambda r: ((hears[r] & ~reached).bit_count(), -r), default=None)
                if row is None or not hears[row] & ~reached:
                    break
                following.update(dict.fromkeys(_rows(hears[row] & ~reached), row))
                reached |= hears[row]
                relays.append((row, level.pop(row)))
            level = following
        missing = ((1 << len(hears)) - 1) & ~reached
        self._uncovered[self._swarm.nodes[root]] = tuple(self._swarm.nodes[row] for row in _rows(missing))
        return relays

    def table(self) -> Timetable:
        used = sum(1 for sending in self._sending if sending)
        return Timetable(tuple(sorted(self._turns)), dict(self._spans), dict(self._uncovered), used)


def _rows(bits: int) -> list[int]:
    """The rows of a bit set, ascending."""
    return [row for row in range(bits.bit_length()) if bits >> row & 1]
