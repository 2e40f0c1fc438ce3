"""A timetable as one node follows it: the turns in which this node begins floods, relays, repeats and calls.

`timetabling.py` makes it from the timetable of the whole swarm (`fitted_timetable.py`) when a schedule is complete.
`timetables_in_force.py` keeps those that the node follows at present.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple, Self

from fanet_mw.routing.clustered.roles.leader_election import Authority
from fanet_mw.routing.clustered.roles.membership import Version
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.delivery_odds import Odds
from fanet_mw.routing.clustered.timetable.fitted_timetable import NO_LOADS, FittedTimetable
from fanet_mw.routing.clustered.timetable.timetable import Timetable
from fanet_mw.units import NodeId

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
