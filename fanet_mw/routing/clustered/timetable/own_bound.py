"""The delay bounds that a timetable gives to a node's own packets, by priority class, from application to application.

    the application sends | lead | wait for a turn of this node, flood | handover | lead | all applications have it
                                 |----------- `Turns.done_ns` ---------|
    `around_ns` is the sum of the other three parts: a lead, the handover, and a second lead

Each class has room of its own in each turn (`turn_release.py`), but a packet larger than that waits as bulk does, and a
leader's bulk has no bound. Bulk at regular intervals has the worst case over its busy period (`Turns.worst_ns`); for
other classes the bound holds for a packet that finds fewer than `BURST` of its class waiting.
"""

from typing import Final, NamedTuple

from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.wire.loads import AS_EXPECTED

BURST: Final = 3
"""In a class without a least interval, so many packets may wait at once and still have a bound."""


class RootTurns(NamedTuple):
    """The turns of one node's own packets in a timetable: those in which the node is the root of a flood."""

    turns: Turns
    roots: tuple[int, ...]
    """The offsets of these turns, ascending."""
    span: int
    """The duration of each flood, in turns: from one of these turns until all nodes have the packet."""
    together: int = 1
    """The number of bulk packets that one turn transmits."""
    around_ns: int = 0
    """The time before a turn and after a flood: a lead, the handover of the reception, and a second lead."""
    load: int = AS_EXPECTED
    """The load for which the timetable was made, in packets in 100 s; by default what the scenario says."""

    def worst_ns(self, *, interval_ns: int) -> int | None:
        """The bound of bulk packets that come at least `interval_ns` apart; None if the turns cannot carry them."""
        worst_ns = self.turns.worst_ns(self.roots, span=self.span, interval_ns=interval_ns, together=self.together)
        return None if worst_ns is None else worst_ns + self.around_ns

    def burst_ns(self, *, per_turn: int) -> int:
        """The bound of a packet that finds fewer than `BURST` of its class, when each turn sends `per_turn` of them."""
        needed = -(-BURST // per_turn)
        done_ns = self.turns.done_ns(self.roots, span=self.span)
        periods, last = divmod(needed - 1, len(done_ns))
        return periods * self.turns.period_ns + done_ns[last] + self.around_ns
