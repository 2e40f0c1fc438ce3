"""A timetable with the uses of its turns: as it is found for a swarm, and as one node follows it."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple, Self

from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.delivery_odds import Odds
from fanet_mw.routing.clustered.timetable.timetable import Timetable
from fanet_mw.units import NodeId

NO_LOADS: Final[Mapping[NodeId, int]] = MappingProxyType({})
"""All nodes send as the scenario states."""


class Fitted(NamedTuple):
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


class TurnPlan(NamedTuple):
    """A timetable that is in force from an instant on, as one node needs it."""

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
    together: int
    frame_bytes: int
    whole: bool
    odds: Odds | None
    loads: Mapping[NodeId, int] = NO_LOADS

    @classmethod
    def of(cls, node: NodeId, valid_ns: int, found: Fitted) -> Self:
        turns, table = found.turns, found.table
        sends: dict[tuple[NodeId, int], list[int]] = {}
        for turn in sorted(table.turns):
            if turn.node == node:
                sends.setdefault((turn.root, turn.instance), []).append(turn.offset)
        own = [offsets for (root, _), offsets in sends.items() if root == node]
        return cls(
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
        """The geometry, and the turns in which this node transmits new packets, as JSON values."""
        return {**self.turns.report(), "own": list(self.roots)}
