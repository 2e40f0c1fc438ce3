"""The delay bounds that a timetable gives to a node's own packets, by priority class, from application to application.

    the application sends | lead | wait for a turn of this node, flood | handover | lead | all applications have it
                                 |----------- `Turns.done_ns` ---------|
    `around_ns` is the sum of the other three parts: a lead, the handover, and a second lead

The first lead is the time by which a frame is announced to the radio before its turn. The handover is the time in which
a reception gets from the radio to its node's process (`radio.handover_ms`), and the second lead is the time by which
that process may wake up too late.

Each class has room of its own in each turn (`turn_release.py`), so a class does not wait for another one. There are two
exceptions. A packet that is larger than the room of its class waits as bulk does. A leader's announcements take the
room of bulk, so a leader's bulk packets have no bound (`stated_delays.py`). Within a class no later packet delays an
earlier one.

There are two kinds of bounds. Bulk that comes at regular intervals has the worst case over its busy period
(`Turns.worst_ns`). For all other classes the bound holds for a packet that finds fewer than `BURST` packets of its
class waiting. A source never exceeds that number if it conforms to a token bucket of depth `BURST` that is filled at
the rate of the turns. A packet that finds more packets waiting has no bound.
"""

from typing import Final, NamedTuple

from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.wire.loads import AS_EXPECTED

BURST: Final = 3
"""In a class without a least interval, this many packets may wait at once, the last one included, and still have a
bound."""


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
