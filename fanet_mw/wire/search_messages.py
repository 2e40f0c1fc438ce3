"""All messages that searching UAVs send each other, found in a frame."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from fanet_mw.wire.bids import Bids, checked_bids
from fanet_mw.wire.frame import BIDS, FOUND, ORDER, ROLL, SEARCH, STATUS, SURVIVOR, Packed, fields_of_each
from fanet_mw.wire.roll import Roll
from fanet_mw.wire.search_plan import Search, SearchStatus
from fanet_mw.wire.survivors import Found, Survivor
from fanet_mw.wire.told_order import ToldOrder

Told = Survivor | Search | SearchStatus | Bids | Found | Roll | ToldOrder
"""The messages that searching UAVs, and a post on the ground, send each other."""
_CHECKED: Final[Mapping[int, Callable[[tuple[Any, ...]], Told]]] = {
    SURVIVOR.msgid: Survivor.checked,
    SEARCH.msgid: Search.checked,
    STATUS.msgid: SearchStatus.checked,
    BIDS.msgid: checked_bids,
    FOUND.msgid: Found.checked,
    ROLL.msgid: Roll.checked,
    ORDER.msgid: ToldOrder.checked,
}


def told_in(packed: Packed) -> tuple[Told, ...]:
    """Every message of a search in a frame, in order; raises MalformedFrameError."""
    return tuple(_CHECKED[spec.msgid](fields) for spec, fields in fields_of_each(packed) if spec.msgid in _CHECKED)
