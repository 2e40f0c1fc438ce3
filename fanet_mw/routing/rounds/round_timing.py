"""Round geometry: which instant belongs to whose turn, and which to bulk. Pure functions of time.

    |<------------------------------- period ------------------------------->|
    |<---------- block ---------->|<---------- block ---------->| ...        |
    | turn | turn | ... | slot | ... | turn | turn | ... | slot | ... | ...  |

A turn holds one frame: DIFS, the longest backoff that an earlier frame may have left behind, the airtime
(`airtime.longest_access_ns`), and a slack for clocks and propagation. The order of the turns is that of the node ids,
so a node knows its turn from the number of nodes alone. The slots are for bulk (`bulk_slots.py`), and have numbers that
go on from round to round. Blocks have equal parts of both, because what goes to a neighbor at once waits while turns
last.
"""

from bisect import bisect_right
from collections.abc import Callable
from operator import attrgetter
from typing import Final, NamedTuple

from fanet_mw import airtime
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, US

_LEAST_SLOTS: Final = 4
"""The bulk slots of a block at least, if there are any."""
_TURNS_NS: Final = 11 * MS
"""The turns of one block last about this long, so that a packet for a neighbor takes less than 20 ms: it may have to
wait for them, and for the last two slots before. With too few bulk slots there are fewer blocks, with longer turns.
"""
_TOGETHER: Final = 2
"""The longest bulk packets that share a frame, if the radio allows it."""
_URGENT_BYTES: Final = 200
"""The room for urgent packets beside them."""


class Block(NamedTuple):
    """A part of each round: turns, then slots. Instants count from the start of the round."""

    start_ns: int
    slots_start_ns: int
    """The end of its turns."""
    end_ns: int
    turns_before: int
    slots_before: int
    slots: int


_Key = Callable[[Block], int]
_START: Final[_Key] = attrgetter("start_ns")
_TURNS_BEFORE: Final[_Key] = attrgetter("turns_before")
_SLOTS_BEFORE: Final[_Key] = attrgetter("slots_before")


class RoundTiming(NamedTuple):
    """The rounds of one swarm."""

    nodes: int
    turn_ns: int
    period_ns: int
    turn_bytes: int
    """The greatest size of the frame of a turn."""
    slots: int
    """The bulk slots of a round; 0 if bulk goes in turns."""
    slot_bytes: int
    """The greatest size of a frame of bulk."""
    slot_ns: int
    hasty_bytes: int
    """The part of such a frame that urgent packets may take."""
    blocks: tuple[Block, ...]

    @classmethod
    def of(cls, scenario: Scenario) -> "RoundTiming":
        rounds, nodes, radio = scenario.rounds, scenario.node_count, scenario.radio
        slack_ns = round(rounds.turn_slack_us * US)
        turn_bytes = min(rounds.turn_bytes, radio.max_frame_bytes)
        slot_bytes = min(
            max(turn_bytes, _TOGETHER * scenario.longest_bulk_bytes + _URGENT_BYTES), radio.max_frame_bytes
        )
        turn_ns = airtime.longest_access_ns(turn_bytes, radio) + slack_ns
        slot_ns = airtime.longest_access_ns(slot_bytes, radio) + slack_ns
        turns_ns = nodes * turn_ns
        period_ns = max(round(turns_ns / (1 - rounds.bulk_share)), round(rounds.least_period_ms * MS))
        slots = max((period_ns - turns_ns) // slot_ns, _LEAST_SLOTS) if rounds.bulk_share else 0
        period_ns = max(period_ns, turns_ns + slots * slot_ns)
        hasty_bytes = max(_URGENT_BYTES, slot_bytes - _TOGETHER * scenario.longest_bulk_bytes)
        count = max(1, min(-(-turns_ns // _TURNS_NS), slots // _LEAST_SLOTS, nodes))
        parts = [(nodes * part // count, slots * part // count) for part in range(count + 1)]
        starts_ns = [turns * turn_ns + earlier * slot_ns for turns, earlier in parts[:-1]]
        blocks = tuple(
            Block(start_ns, start_ns + (later[0] - turns) * turn_ns, end_ns, turns, earlier, later[1] - earlier)
            for (turns, earlier), later, start_ns, end_ns in zip(
                parts[:-1], parts[1:], starts_ns, [*starts_ns[1:], period_ns], strict=True
            )
        )
        return cls(nodes, turn_ns, period_ns, turn_bytes, slots, slot_bytes, slot_ns, hasty_bytes, blocks)

    def turn_start_ns(self, node: int, *, from_ns: int) -> int:
        """The start of the first turn of a node that begins at or after an instant."""
        block = self._last(_TURNS_BEFORE, node - 1)
        offset_ns = block.start_ns + (node - 1 - block.turns_before) * self.turn_ns
        return -((offset_ns - from_ns) // self.period_ns) * self.period_ns + offset_ns

    def owner(self, end_ns: int) -> int | None:
        """The node in whose turn a frame ended at an instant; None among the slots."""
        within_ns = (end_ns - 1) % self.period_ns
        block = self._last(_START, within_ns)
        if within_ns >= block.slots_start_ns:
            return None
        return block.turns_before + (within_ns - block.start_ns) // self.turn_ns + 1

    def slot_start_ns(self, number: int) -> int:
        round_number, slot = divmod(number, self.slots)
        block = self._last(_SLOTS_BEFORE, slot)
        return round_number * self.period_ns + block.slots_start_ns + (slot - block.slots_before) * self.slot_ns

    def slot_from(self, from_ns: int) -> int:
        """The number of the first bulk slot that starts at or after an instant."""
        round_number, within_ns = divmod(from_ns, self.period_ns)
        block = self._last(_START, within_ns)
        passed = max(0, -((block.slots_start_ns - within_ns) // self.slot_ns))
        return round_number * self.slots + block.slots_before + min(block.slots, passed)

    def between_turns_ns(self, from_ns: int) -> int:
        """The first instant, at or after another one, from which a frame ends before the next turn."""
        within_ns = from_ns % self.period_ns
        block = self._last(_START, within_ns)
        if within_ns < block.slots_start_ns:
            return from_ns + block.slots_start_ns - within_ns
        usable_ns = max(1, block.slots - 2) * self.slot_ns
        if within_ns < block.slots_start_ns + usable_ns:
            return from_ns
        return self.between_turns_ns(from_ns + block.end_ns - within_ns)

    def _last(self, key: _Key, value: int) -> Block:
        """The last block whose key is not greater than a value."""
        return self.blocks[bisect_right(self.blocks, value, key=key) - 1]
