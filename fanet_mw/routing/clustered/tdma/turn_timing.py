"""The geometry of a superframe with collision-free floods: a contention window, then turns of equal length. Pure
functions of time.

A turn has room for one frame of the largest size, the DIFS before it, the longest backoff that an earlier frame may
have left behind, and a slack for the error of the clocks. The *root* of a flood is the node at which it begins; the
*span* is the number of turns from that turn until all nodes have the packet, the first and the last one included.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw.airtime import longest_access_ns
from fanet_mw.bounds import turn_service
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, US

TAIL_NS: Final = 5 * MS
"""In this last part of the contention window no frame becomes due, so that all are over when turns begin."""


class Turns(NamedTuple):
    """The geometry of a superframe: its contention window, and the turns of equal length after it."""

    origin_ns: int
    period_ns: int
    contention_ns: int
    turn_ns: int
    per_superframe: int

    def superframe_start_ns(self, t_ns: int) -> int:
        return t_ns - (t_ns - self.origin_ns) % self.period_ns

    def start_ns(self, offset: int, *, superframe_start_ns: int) -> int:
        """The start of turn `offset` of a superframe; it may lie in a later one."""
        later, turn = divmod(offset, self.per_superframe)
        return superframe_start_ns + later * self.period_ns + self.contention_ns + turn * self.turn_ns

    def turn_at(self, t_ns: int) -> int | None:
        phase_ns = (t_ns - self.origin_ns) % self.period_ns - self.contention_ns
        turn = phase_ns // self.turn_ns
        return turn if phase_ns >= 0 and turn < self.per_superframe else None

    def next_start_ns(self, offsets: Sequence[int], *, not_before_ns: int) -> int:
        """The first start, from an instant on, of a turn with one of these offsets (ascending)."""
        first_ns = self.superframe_start_ns(not_before_ns)
        for superframe_start_ns in (first_ns, first_ns + self.period_ns):
            for offset in offsets:
                start_ns = self.start_ns(offset, superframe_start_ns=superframe_start_ns)
                if start_ns >= not_before_ns:
                    return start_ns
        raise AssertionError("offsets are turns of one superframe, so one of the next lies ahead")

    def contending_ns(self, start_ns: int, random: Callable[[], float]) -> int:
        """When a frame due at `start_ns` may contend: then, but not late in a window, or at random in the next."""
        open_ns = max(1, self.contention_ns - TAIL_NS)
        superframe_ns = self.superframe_start_ns(start_ns)
        if start_ns - superframe_ns < open_ns:
            return start_ns
        return superframe_ns + self.period_ns + int(random() * open_ns)

    def worst_ns(self, roots: Sequence[int], *, span: int, interval_ns: int, together: int = 1) -> int | None:
        """A bound of the delay of packets `interval_ns` apart, from generation until all nodes have them, or None if
        too many; `together` go in each turn of `roots` (`fanet_mw/bounds/turn_service.py`).
        """
        return turn_service.worst_ns(
            self.done_ns(roots, span=span), period_ns=self.period_ns, interval_ns=interval_ns, together=together
        )

    def done_ns(self, roots: Sequence[int], *, span: int) -> list[int]:
        """For each n: the longest time from just after one of `roots` until all have the n-th one's packets."""
        starts = [self.start_ns(offset, superframe_start_ns=0) for offset in roots]
        floods = [self.flood_ns(offset, span=span) for offset in roots]
        return turn_service.done_ns(starts, floods, period_ns=self.period_ns)

    def flood_ns(self, offset: int, *, span: int) -> int:
        """The duration of a flood of `span` turns from turn `offset` on, including contention windows in between."""
        last_ns = self.start_ns(offset + span - 1, superframe_start_ns=0)
        return last_ns + self.turn_ns - self.start_ns(offset, superframe_start_ns=0)

    def report(self) -> Mapping[str, object]:
        return {
            "start_ms": self.origin_ns / MS,
            "period_ms": self.period_ns / MS,
            "contention_ms": self.contention_ns / MS,
            "turn_ms": self.turn_ns / MS,
        }


def turn_slack_ns(scenario: Scenario) -> int:
    """What a turn has beyond DIFS, the longest backoff and the largest frame; limits how far clocks may be apart."""
    return round(scenario.clusters.turn_slack_us * US)


def turn_ns(scenario: Scenario, *, payload_bytes: int) -> int:
    """The length of a turn for such a frame, with slack for propagation, detection and errors of clocks."""
    return longest_access_ns(payload_bytes, scenario.radio) + turn_slack_ns(scenario)


def receipt_ns(scenario: Scenario) -> int:
    """From a frame's end until the application has it: the handover, and one lead, as a process may wake so late."""
    return scenario.radio.handover_ns + scenario.radio.lead_ns
