"""Who sends in a bulk slot: of the nodes within two hops of each other one, by a hash of its id and the slot's number.

Nodes that could collide at a common neighbor know of each other by what neighbors state, so both come to the same
result without a word (NAMA; Bao and Garcia-Luna-Aceves, "A new approach to channel access scheduling for ad hoc
networks", MobiCom 2001). A node with little to send takes part in a few slots only, and says so.
"""

from collections.abc import Sequence
from functools import lru_cache
from struct import unpack
from typing import Final

from fanet_mw.routing.rounds.round_timing import RoundTiming

SELDOM: Final = 8
"""A node with little to send takes part in one of so many slots."""
_MOST_SEARCHED: Final = 4096
_BLOCK: Final = 64
"""Bids are computed for so many slots at once: each is a lane of 64 bits of one long integer, in which products of 32
bits do not reach the next lane.
"""
_LANES: Final = sum(1 << 64 * lane for lane in range(_BLOCK))
_ORDER: Final = sum(lane << 64 * lane for lane in range(_BLOCK))
_BITS: Final = 0xFFFFFFFF
_LOW: Final = _LANES * _BITS
_REMEMBERED: Final = 2048
"""The blocks of bids that a process remembers: those of 100 nodes for 1,300 slots, as each node asks for those of its
rivals.
"""


@lru_cache(maxsize=_REMEMBERED)
def _bids(node: int, block: int, in_each_slot: bool) -> tuple[int, ...]:
    """What a node bids for each slot of a block, the highest bid wins; -1 where it takes no part."""
    first = (node * 0x9E3779B1 + block * _BLOCK * 0x85EBCA77) & _BITS
    mixed = (_LANES * first + _ORDER * 0x85EBCA77) & _LOW
    mixed = (mixed ^ mixed >> 15 & _LOW) * 0x2C1B3C6D & _LOW
    mixed = (mixed ^ mixed >> 12 & _LOW) * 0x297A2D39 & _LOW
    mixed ^= mixed >> 15 & _LOW
    bids = unpack(f"<{_BLOCK}Q", mixed.to_bytes(8 * _BLOCK, "little"))
    return bids if in_each_slot else tuple([-1 if bid % SELDOM else bid for bid in bids])


class BulkSlots:
    """The bulk slots of one node."""

    def __init__(self, node: int, timing: RoundTiming) -> None:
        self._node = node
        self._timing = timing

    def next_ns(self, from_ns: int, *, in_each_slot: bool, rivals: Sequence[tuple[int, bool]]) -> int:
        """The start of the first own slot from an instant on, or of one much later if none is found; `rivals`: other
        nodes within two hops, and whether each takes part in all slots or in few.
        """
        first = self._timing.slot_from(from_ns)
        block, start = divmod(first, _BLOCK)
        while block * _BLOCK < first + _MOST_SEARCHED:
            own = _bids(self._node, block, in_each_slot)
            others = [_bids(node, block, takes_part) for node, takes_part in rivals]
            for at in range(start, _BLOCK):
                bid = own[at]
                if bid < 0:
                    continue
                for theirs in others:
                    if theirs[at] >= bid:
                        break
                else:
                    return self._timing.slot_start_ns(block * _BLOCK + at)
            block, start = block + 1, 0
        return self._timing.slot_start_ns(first + _MOST_SEARCHED)
