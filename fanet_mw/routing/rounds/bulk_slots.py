"""Who sends in a bulk slot: of the nodes within two hops of each other one, by a hash of its id and the slot's number.

Nodes that could collide at a common neighbor know of each other by what neighbors state, so both come to the same
result without a word (NAMA; Bao and Garcia-Luna-Aceves, "A new approach to channel access scheduling for ad hoc
networks", MobiCom 2001). A node with little to send takes part in a few slots only, and says so.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Final

from fanet_mw.routing.rounds.round_timing import RoundTiming

SELDOM: Final = 8
"""A node with little to send takes part in one of so many slots."""
_MOST_SEARCHED: Final = 4096
_MASK: Final = 0xFFFFFFFF
_REMEMBERED: Final = 1 << 14
"""The bids that a process remembers: those of 100 nodes for 160 slots, as each node asks for those of its rivals."""


@lru_cache(maxsize=_REMEMBERED)
def _bid(node: int, slot: int) -> int:
    """What a node bids for a slot: the highest bid wins it."""
    mixed = (node * 0x9E3779B1 + slot * 0x85EBCA77) & _MASK
    mixed = (mixed ^ mixed >> 15) * 0x2C1B3C6D & _MASK
    mixed = (mixed ^ mixed >> 12) * 0x297A2D39 & _MASK
    return mixed ^ mixed >> 15


class BulkSlots:
    """The bulk slots of one node."""

    def __init__(self, node: int, timing: RoundTiming) -> None:
        self._node = node
        self._timing = timing

    def next_ns(self, from_ns: int, *, in_each_slot: bool, rivals: Sequence[tuple[int, bool]]) -> int:
        """The start of the first own slot from an instant on; `rivals`: other nodes within two hops, and whether each
        takes part in all slots, or where the last bits of its bid are 0.
        """
        first = self._timing.slot_from(from_ns)
        for slot in range(first, first + _MOST_SEARCHED):
            own = _bid(self._node, slot)
            if own % SELDOM and not in_each_slot:
                continue
            for node, takes_part in rivals:
                theirs = _bid(node, slot)
                if theirs >= own and (takes_part or not theirs % SELDOM):
                    break
            else:
                return self._timing.slot_start_ns(slot)
        return self._timing.slot_start_ns(first + _MOST_SEARCHED)
