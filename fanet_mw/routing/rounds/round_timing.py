"""Round geometry: which instant belongs to whose turn, and which to bulk. Pure functions of time.

    |<-------------------------------- period --------------------------------->|
    | turn of node 1 | turn of node 2 | ... | turn of node n |   bulk window     |

A turn holds one frame: DIFS, the longest backoff that an earlier frame may have left behind, the airtime
(`airtime.longest_access_ns`), and a slack for clocks and propagation. The order of the turns is that of the node ids,
so a node knows its turn from the number of nodes alone. In the window nodes contend.
"""

from typing import Final, NamedTuple

from fanet_mw import airtime
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, US

_LEAST_FRAMES: Final = 4
"""The bulk frames for which a window, if there is one, has room at least."""


class RoundTiming(NamedTuple):
    """The rounds of one swarm."""

    nodes: int
    turn_ns: int
    period_ns: int
    turn_bytes: int
    """The greatest size of the frame of a turn."""
    window_ns: int
    """Length of the bulk window; 0 if bulk goes in turns."""
    bulk_bytes: int
    """The greatest size of a frame of bulk."""
    bulk_ns: int
    """The longest time that such a frame takes at an idle medium."""

    @classmethod
    def of(cls, scenario: Scenario) -> "RoundTiming":
        """The rounds that a scenario asks for."""
        rounds, nodes, radio = scenario.rounds, scenario.node_count, scenario.radio
        slack_ns = round(rounds.turn_slack_us * US)
        turn_bytes = min(rounds.turn_bytes, radio.max_frame_bytes)
        bulk_bytes = min(max(turn_bytes, scenario.longest_bulk_bytes), radio.max_frame_bytes)
        turn_ns = airtime.longest_access_ns(turn_bytes, radio) + slack_ns
        bulk_ns = airtime.longest_access_ns(bulk_bytes, radio) + slack_ns
        turns_ns = nodes * turn_ns
        period_ns = max(round(turns_ns / (1 - rounds.bulk_share)), round(rounds.least_period_ms * MS))
        window_ns = max(period_ns - turns_ns, _LEAST_FRAMES * bulk_ns) if rounds.bulk_share else 0
        period_ns = max(period_ns, turns_ns + window_ns)
        return cls(nodes, turn_ns, period_ns, turn_bytes, window_ns, bulk_bytes, bulk_ns)

    def turn_start_ns(self, node: int, *, from_ns: int) -> int:
        """The start of the first turn of a node that begins at or after an instant."""
        offset_ns = (node - 1) * self.turn_ns
        return -((offset_ns - from_ns) // self.period_ns) * self.period_ns + offset_ns

    def in_window_ns(self, t_ns: int) -> int:
        """The time since the latest bulk window began, before an instant."""
        return (t_ns - self.nodes * self.turn_ns) % self.period_ns

    def window_start_ns(self, from_ns: int, *, wait_ns: int) -> int:
        """The instant that comes after so much of the bulk windows has passed, from an instant on, and at which a frame
        of bulk that has to wait for another one still ends within its window.
        """
        usable_ns = self.window_ns - 2 * self.bulk_ns
        within_ns = self.in_window_ns(from_ns)
        begin_ns = from_ns - within_ns
        if within_ns >= usable_ns:
            begin_ns, within_ns = begin_ns + self.period_ns, 0
        further, within_ns = divmod(within_ns + wait_ns, usable_ns)
        return begin_ns + further * self.period_ns + within_ns
