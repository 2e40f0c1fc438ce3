"""The delay within which most copies of a packet arrive over lossy links: the flood, and the repairs after it.

delay = longest wait for a turn + flood + one turn + time until repair begins
        + rounds of repair x (interval of hellos + wait of the hello for its turn + answer)
"""

from typing import Final

from fanet_mw.routing.clustered.timetable.node_timetable import NodeTimetable
from fanet_mw.routing.packet_repair import RIPE_NS
from fanet_mw.trace import LIKELY_SHARE
from fanet_mw.units import NodeId

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
