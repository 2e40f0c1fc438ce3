"""The delays that a timetable gives to a node's own packets, from application to application: bounds by priority class,
and over lossy links the delay within which most copies arrive.

    the application sends | lead | wait for a turn of this node, flood | handover | lead | all applications have it
                                 |----------- `Turns.done_ns` ---------|
    `around_ns` is the sum of the other three parts: a lead, the handover, and a second lead

Each class has room of its own in each turn (`turn_release.py`), but a packet larger than that waits as bulk does, and a
leader's bulk has no bound. Bulk at regular intervals has the worst case over its busy period (`Turns.worst_ns`); for
other classes the bound holds for a packet that finds fewer than `BURST` of its class waiting.

    likely delay = longest wait for a turn + flood + one turn + time until repair begins
                   + rounds of repair x (interval of hellos + wait of the hello for its turn + answer)
"""

from typing import Final, NamedTuple

from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.node_timetable import NodeTimetable
from fanet_mw.routing.packet_repair import RIPE_NS
from fanet_mw.trace import LIKELY_SHARE
from fanet_mw.units import NodeId
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


_LATE_HELLO: Final = 1.1
"""The longest time between two hellos, in hello intervals."""
_BUSY: Final = 2
"""The factor by which a round of repair takes longer because answers to other nodes wait in the same queue."""


def likely_delay_ns(
    timetable: NodeTimetable, node: NodeId, *, waiting: int, interval_ns: int, hello_ns: int
) -> int | None:
    """When `LIKELY_SHARE` of the copies of a node's packets have arrived; None if fewer ever do. The longest wait for a
    turn (of the last of `waiting`, with one more join), the flood, and rounds of repair, in each of which the hello is
    as late as it may be, and the answer may wait for the turn after next; the odds account for half of the missing
    copies.
    """
    turns, span = timetable.turns, timetable.table.spans[node]
    assert timetable.odds is not None, "whoever asks has a timetable for lossy links"
    flood_ns = turns.worst_ns(timetable.roots, span=span, interval_ns=interval_ns)
    rounds = timetable.odds.rounds(node, missed=(1 - LIKELY_SHARE) / 2)
    if flood_ns is None or rounds is None or not timetable.calls:
        return None
    call_ns = turns.done_ns(timetable.calls, span=1)[0]
    superframes, turn = divmod(max(waiting, 1) - 1, len(timetable.roots))
    queued_ns = superframes * turns.period_ns + turns.done_ns(timetable.roots, span=span)[turn]
    wait_ns = max(flood_ns, queued_ns) + turns.period_ns // len(timetable.roots)
    round_ns = _BUSY * (round(_LATE_HELLO * hello_ns) + 3 * call_ns)
    return wait_ns + (RIPE_NS if rounds else 0) + rounds * round_ns
