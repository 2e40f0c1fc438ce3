"""The delay bounds that a timetable gives to a node's own packets, by priority class, from application to application.

    hand-over -- lead -- wait for a turn -- flood -- handover, receipt --> the other application
                         | up to `done_ns` of the turn that lets the packet out |

Each class has room of its own in each turn (`root_release.py`), so no class waits for another, and no later packet
overtakes an earlier one of its class. For a class that sends at intervals, the bound is the worst case over its busy
period (`Turns.worst_ns`). For any other class, the bound holds for a packet that finds fewer than `BURST` packets of
its class waiting; a token bucket of that depth, with the rate of the turns, would accept all of those. A packet that
finds more waiting has no bound.
"""

from typing import Final, NamedTuple

from fanet_mw.routing.clustered.tdma.turns import Turns
from fanet_mw.wire.loads import AS_EXPECTED

BURST: Final = 3
"""In a class without a least interval, this many packets may wait at once, the last one included, and still have a
bound."""


class OwnBound(NamedTuple):
    """A node's share of a timetable: its turns, and the duration of its floods."""

    turns: Turns
    roots: tuple[int, ...]
    span: int
    together: int = 1
    """The number of bulk packets that one turn transmits."""
    around_ns: int = 0
    """The time before a turn and after a flood: the lead, the handover of the reception, and the receipt."""
    load: int = AS_EXPECTED
    """The load for which the timetable was made, in packets in 100 s; by default what the scenario says."""

    def worst_ns(self, *, interval_ns: int) -> int | None:
        """The bound of bulk packets that come at least `interval_ns` apart; None if the turns cannot carry so many."""
        worst_ns = self.turns.worst_ns(self.roots, span=self.span, interval_ns=interval_ns, together=self.together)
        return None if worst_ns is None else worst_ns + self.around_ns

    def burst_ns(self, *, per_turn: int) -> int:
        """The bound of a packet that finds fewer than `BURST` of its class waiting, if each turn transmits `per_turn`
        of them.
        """
        needed = -(-BURST // per_turn)
        done_ns = self.turns.done_ns(self.roots, span=self.span)
        periods, last = divmod(needed - 1, len(done_ns))
        return periods * self.turns.period_ns + done_ns[last] + self.around_ns
