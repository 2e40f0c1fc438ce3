"""A timetable as one node follows it: the turns in which this node begins floods, relays, repeats and calls.

`turn_allocation.py` finds a timetable for the whole swarm and its load (`FittedTimetable`), and `timetabling.py` makes
that of a node from it when a schedule is complete. A node may follow several at present (`TimetablesInForce`).
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple, Self

from fanet_mw.routing.clustered.roles.leader_election import Authority
from fanet_mw.routing.clustered.roles.membership import Version
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.delivery_odds import Odds
from fanet_mw.routing.clustered.timetable.timetable import Timetable
from fanet_mw.units import NodeId

NO_LOADS: Final[Mapping[NodeId, int]] = MappingProxyType({})
"""All nodes send as the scenario states."""


class FittedTimetable(NamedTuple):
    """A timetable, and how its turns are used."""

    turns: Turns
    table: Timetable
    together: int
    """The greatest number of packets that a root transmits in one turn."""
    frame_bytes: int
    """The number of bytes that one turn can carry."""
    whole: bool
    """True if each node transmits its own packets; otherwise heads transmit those of their members."""
    enough: bool
    """True if the turns suffice for the load."""
    odds: Odds | None = None
    """The odds of a timetable for lossy links; None for a timetable that assumes no losses."""
    loads: Mapping[NodeId, int] = NO_LOADS
    """The loads for which the timetable was made, of the nodes that do not send as the scenario states."""


UNANNOUNCED: Final = Version(Authority(0, NodeId(0)), 0)
"""Of no leader: a timetable that is computed before take-off."""


class NodeTimetable(NamedTuple):
    """A timetable that is in force from an instant on, as one node needs it."""

    version: Version
    """The schedule from which it was made."""
    valid_ns: int
    turns: Turns
    table: Timetable
    mine: Mapping[tuple[NodeId, int], tuple[int, ...]]
    """The turns in which this node relays, for each (root, instance)."""
    heard: Mapping[tuple[int, NodeId], tuple[int, NodeId, int]]
    """The flood that is received in each turn from each sender, as (offset, root, instance)."""
    roots: tuple[int, ...]
    """The turns in which this node transmits new packets."""
    again: Mapping[int, tuple[int, ...]]
    """The later turns in which this node repeats what it has transmitted in each of its root turns."""
    calls: tuple[int, ...]
    """The turns in which this node transmits frames that only its neighbors need."""
    spare: tuple[int, ...]
    """The turns in which this node transmits packets for one of its neighbors."""
    near: frozenset[NodeId]
    """The neighbors that hear it in these turns."""
    together: int
    frame_bytes: int
    whole: bool
    odds: Odds | None
    loads: Mapping[NodeId, int] = NO_LOADS

    @classmethod
    def of(cls, node: NodeId, valid_ns: int, found: FittedTimetable, *, version: Version = UNANNOUNCED) -> Self:
        turns, table = found.turns, found.table
        sends: dict[tuple[NodeId, int], list[int]] = {}
        for turn in sorted(table.turns):
            if turn.node == node:
                sends.setdefault((turn.root, turn.instance), []).append(turn.offset)
        own = [offsets for (root, _), offsets in sends.items() if root == node]
        return cls(
            version=version,
            valid_ns=valid_ns,
            turns=turns,
            table=table,
            mine={flood: tuple(offsets) for flood, offsets in sends.items() if flood[0] != node},
            heard={
                (turn.offset % turns.per_superframe, turn.node): (turn.offset, turn.root, turn.instance)
                for turn in table.turns
            },
            roots=tuple(sorted(offsets[0] for offsets in own)),
            again={offsets[0]: tuple(offsets[1:]) for offsets in own},
            calls=table.calls.get(node, ()),
            spare=table.spare.get(node, ()),
            near=table.near.get(node, frozenset()),
            together=found.together,
            frame_bytes=found.frame_bytes,
            whole=found.whole,
            odds=found.odds,
            loads=found.loads,
        )

    def has_turns(self, node: NodeId) -> bool:
        """True if this node transmits its packets itself."""
        return node in self.table.spans

    def report(self) -> Mapping[str, object]:
        return {**self.turns.report(), "own": list(self.roots)}


class TimetablesInForce:
    """The timetables of one node, in the order in which they come into force."""

    def __init__(self) -> None:
        self.in_order: list[NodeTimetable] = []
        self._left: Turns | None = None
        """The superframe of the timetable that others may keep and this node does not; None if it would know."""

    @property
    def newest(self) -> NodeTimetable | None:
        return self.in_order[-1] if self.in_order else None

    def at(self, t_ns: int) -> NodeTimetable | None:
        for timetable in reversed(self.in_order):
            if timetable.valid_ns <= t_ns:
                return timetable
        return None

    def turns_at(self, t_ns: int) -> Turns | None:
        timetable = self.at(t_ns)
        return self._left if timetable is None else timetable.turns

    def superseded(self, now_ns: int) -> int:
        """The number of timetables, the oldest first, that are no longer in force."""
        return sum(timetable.valid_ns <= now_ns for timetable in self.in_order[1:])

    def follow(self, timetable: NodeTimetable | None, *, now_ns: int) -> None:
        """Follow a newer timetable (None: none), forgetting those no longer in force, and those due after it: they are
        of a leader over which another prevails.
        """
        if timetable is None:
            self.in_order, self._left = [], None
            return
        before = (older for older in self.in_order[self.superseded(now_ns) :] if older.valid_ns < timetable.valid_ns)
        self.in_order = [*before, timetable]

    def give_up(self, turns: Turns) -> None:
        """Forget all timetables, because this node hears nobody keep them: what it sends keeps out of others' turns,
        which are like `turns` if it has never had any.
        """
        newest, self.in_order = self.newest, []
        self._left = (self._left or turns) if newest is None else newest.turns
