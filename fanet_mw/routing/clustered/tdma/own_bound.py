"""What a timetable promises one node for packets of its own: bounds per class, from application to application.

    hand-over -- lead -- wait for a turn -- flood -- handover, receipt --> the other application
                         | up to `done_ns` of the turn that lets the packet out |

Every class has room of its own in each turn (`root_release.py`), so no class waits for another, and nothing that
comes later overtakes a packet within its class. A class that sends at intervals is bounded over its busy period
(`Turns.worst_ns`); any other one for packets that find fewer than `BURST` of their class waiting: a token bucket of
that depth and of the rate that the turns carry admits all of them. A packet that finds more of its class waiting is let
out later, and has no bound.
"""

from typing import Final, NamedTuple

from fanet_mw.routing.clustered.tdma.turns import Turns

BURST: Final = 3
"""Packets of a class without a least interval that may wait at once, the last one included, and still have a bound."""


class OwnBound(NamedTuple):
    """A node's part of a timetable: its turns, and for how long its floods last."""

    turns: Turns
    roots: tuple[int, ...]
    span: int
    together: int = 1
    """The number of packets of bulk that one of its turns lets out."""
    around_ns: int = 0
    """The time before a turn and after a flood: the lead, the handover of receptions, and the receipt."""

    def worst_ns(self, *, interval_ns: int) -> int | None:
        """The bound of bulk that comes no more often; None: more comes than is let out."""
        worst_ns = self.turns.worst_ns(self.roots, span=self.span, interval_ns=interval_ns, together=self.together)
        return None if worst_ns is None else worst_ns + self.around_ns

    def burst_ns(self, *, per_turn: int) -> int:
        """The bound of a packet that finds fewer than `BURST` of its class waiting; so many leave per turn."""
        needed = -(-BURST // per_turn)
        done_ns = self.turns.done_ns(self.roots, span=self.span)
        periods, last = divmod(needed - 1, len(done_ns))
        return periods * self.turns.period_ns + done_ns[last] + self.around_ns
