"""Round geometry: which instant belongs to whose turn, and which to bulk. Pure functions of time.

    |<-------------------------------- period --------------------------------->|
    | turn of node 1 | turn of node 2 | ... | turn of node n | slot | slot | ... |

A turn holds one frame: DIFS, the longest backoff that an earlier frame may have left behind, the airtime
(`airtime.longest_access_ns`), and a slack for clocks and propagation. The order of the turns is that of the node ids,
so a node knows its turn from the number of nodes alone. The slots after the turns are for bulk (`bulk_slots.py`), and
have numbers that go on from round to round.
"""

from typing import Final, NamedTuple

from fanet_mw import airtime
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, US

_LEAST_SLOTS: Final = 4
"""The bulk slots of a round at least, if there are any."""
_TOGETHER: Final = 2
"""The longest bulk packets that share a frame, if the radio allows it."""
_URGENT_BYTES: Final = 200
"""The room for urgent packets beside them."""


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
        return cls(nodes, turn_ns, period_ns, turn_bytes, slots, slot_bytes, slot_ns, hasty_bytes)

    def turn_start_ns(self, node: int, *, from_ns: int) -> int:
        """The start of the first turn of a node that begins at or after an instant."""
        offset_ns = (node - 1) * self.turn_ns
        return -((offset_ns - from_ns) // self.period_ns) * self.period_ns + offset_ns

    def owner(self, end_ns: int) -> int | None:
        """The node in whose turn a frame ended at an instant; None among the slots."""
        within_ns = (end_ns - 1) % self.period_ns
        return None if within_ns >= self.nodes * self.turn_ns else within_ns // self.turn_ns + 1

    def slot_start_ns(self, number: int) -> int:
        round_number, slot = divmod(number, self.slots)
        return round_number * self.period_ns + self.nodes * self.turn_ns + slot * self.slot_ns

    def slot_from(self, from_ns: int) -> int:
        """The number of the first bulk slot that starts at or after an instant."""
        round_number, within_ns = divmod(from_ns - self.nodes * self.turn_ns, self.period_ns)
        return round_number * self.slots + min(self.slots, -(-within_ns // self.slot_ns))

    def between_turns_ns(self, from_ns: int) -> int:
        """The first instant, at or after another one, from which a frame ends before the next turn."""
        within_ns = (from_ns - self.nodes * self.turn_ns) % self.period_ns
        usable_ns = max(1, self.slots - 2) * self.slot_ns
        return from_ns if within_ns < usable_ns else from_ns + self.period_ns - within_ns
