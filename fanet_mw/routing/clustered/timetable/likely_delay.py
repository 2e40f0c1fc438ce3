"""The delay within which most copies of a node's packets arrive where links lose frames: the flood, then repairs.

delay = longest wait for a turn + flood + one turn more + ripening + rounds of repair x (hello + its turn + answer)
"""

from typing import Final

from fanet_mw.routing.clustered.forwarding.repair import RIPE_NS
from fanet_mw.routing.clustered.timetable.turn_plan import TurnPlan
from fanet_mw.units import NodeId

LIKELY_SHARE: Final = 0.99
"""The share of copies for which a node states a delay when links lose frames."""
_LATE_HELLO: Final = 1.1
"""The most hello intervals between two hellos."""
_BUSY: Final = 2
"""The factor by which a round of repair takes longer than when only one packet is lacking, because answers queue."""


def likely_delay_ns(plan: TurnPlan, node: NodeId, *, waiting: int, interval_ns: int, hello_ns: int) -> int | None:
    """The time within which `LIKELY_SHARE` of the copies of a node's packets arrive; None if the odds are worse.

    The node waits longest for its turn, or for the turn of the last of so many packets that are `waiting`, if that is
    later, as after several joins. One more join may take a turn of the node when a link has changed. Then come the
    flood, and as many rounds of repair as it takes. A round is a hello, as late as it may be, which waits for a turn,
    and an answer, which may wait for the next turn but one. The odds do not know of everything, so they account for
    half of the copies that may be missing.
    """
    turns, span = plan.turns, plan.table.spans[node]
    assert plan.odds is not None, "whoever asks has a timetable for lossy links"
    flood_ns = turns.worst_ns(plan.roots, span=span, interval_ns=interval_ns)
    rounds = plan.odds.rounds(node, missed=(1 - LIKELY_SHARE) / 2)
    if flood_ns is None or rounds is None or not plan.calls:
        return None
    call_ns = turns.done_ns(plan.calls, span=1)[0]
    superframes, turn = divmod(max(waiting, 1) - 1, len(plan.roots))
    queued_ns = superframes * turns.period_ns + turns.done_ns(plan.roots, span=span)[turn]
    wait_ns = max(flood_ns, queued_ns) + turns.period_ns // len(plan.roots)
    round_ns = _BUSY * (round(_LATE_HELLO * hello_ns) + 3 * call_ns)
    return wait_ns + (RIPE_NS if rounds else 0) + rounds * round_ns
