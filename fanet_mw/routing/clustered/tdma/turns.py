"""Superframe geometry of collision-free floods: a contention window, then equal turns. Pure functions of time.

    origin                                            origin + period
    | contention window | turn 0 | turn 1 | ... | rest | contention window | ...

A turn holds one frame, the DIFS before it and the longest backoff that an earlier frame may have left behind, so that
it starts at the beginning of its turn on any 802.11 MAC. Everything else (hellos, joins, unicasts to a head, repairs)
contends in the window.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from fanet_mw.airtime import OVERHEAD_BYTES, Timing, airtime_ns
from fanet_mw.scenario import Scenario
from fanet_mw.timesync.ftsp import MOST_STATED_NS
from fanet_mw.units import MS, US

_FLIGHT_NS: Final = 20 * US
"""Propagation over 6 km; so much of the slack is not for clocks."""
_TAIL_NS: Final = 5 * MS
"""The end of the contention window in which nothing new starts: what contends must be over when the turns begin."""


class Turns(NamedTuple):
    """The geometry of a superframe: its contention window, and turns of equal length after it."""

    origin_ns: int
    period_ns: int
    contention_ns: int
    turn_ns: int
    per_frame: int

    def frame_start_ns(self, t_ns: int) -> int:
        """The beginning of the superframe in which an instant lies."""
        return t_ns - (t_ns - self.origin_ns) % self.period_ns

    def start_ns(self, offset: int, *, frame_start_ns: int) -> int:
        """The start of the `offset`-th turn from a superframe's beginning; offsets may reach into later ones."""
        later, turn = divmod(offset, self.per_frame)
        return frame_start_ns + later * self.period_ns + self.contention_ns + turn * self.turn_ns

    def turn_at(self, t_ns: int) -> int | None:
        """The turn to which an instant belongs; None in the contention window and in the rest."""
        phase_ns = (t_ns - self.origin_ns) % self.period_ns - self.contention_ns
        turn = phase_ns // self.turn_ns
        return turn if phase_ns >= 0 and turn < self.per_frame else None

    def next_start_ns(self, offsets: Sequence[int], *, not_before_ns: int) -> int:
        """The first of the given turns (ascending, of every superframe) that starts at or after an instant."""
        frame_ns = self.frame_start_ns(not_before_ns)
        for frame_start_ns in (frame_ns, frame_ns + self.period_ns):
            for offset in offsets:
                start_ns = self.start_ns(offset, frame_start_ns=frame_start_ns)
                if start_ns >= not_before_ns:
                    return start_ns
        raise AssertionError("offsets are turns of one superframe, so one of the next lies ahead")

    def contending_ns(self, start_ns: int, random: Callable[[], float]) -> int:
        """The instant from which a frame due at `start_ns` may contend: then, or at a random instant of the next
        window.
        """
        open_ns = max(1, self.contention_ns - _TAIL_NS)
        frame_ns = self.frame_start_ns(start_ns)
        if start_ns - frame_ns < open_ns:
            return start_ns
        return frame_ns + self.period_ns + int(random() * open_ns)

    def worst_ns(self, roots: Sequence[int], *, span: int, interval_ns: int, together: int = 1) -> int | None:
        """Sound bound of the delay, generation to everyone, of packets that come every `interval_ns` at their root.

        A root turn lets out as many of them as wait, up to `together`. The q-th packet of a busy period that begins
        just after a root turn is let out in the ceil(q / together)-th one after it: a turn that lets out fewer ends
        the period. `flood_ns` later all have it. Over all q of the busy period and all turns after which it may begin
        (Davis et al., 2007); of those let out together the first waits longest. None when more packets come than are
        let out. Holds while the swarm stays as it was when the table was made, no frame is lost, and nothing of higher
        priority uses the same root.
        """
        if together * len(roots) * interval_ns < self.period_ns:
            return None
        done_ns = self.done_ns(roots, span=span)
        return max(done - later * together * interval_ns for later, done in enumerate(done_ns))

    def done_ns(self, roots: Sequence[int], *, span: int) -> list[int]:
        """The longest time from just after one of the given turns until what the q-th after it lets out is everywhere.

        For q from 1 to the turns of a superframe.
        """
        starts = [self.start_ns(offset, frame_start_ns=0) for offset in roots]
        floods = [self.flood_ns(offset, span=span) for offset in roots]
        horizon = [later * self.period_ns + start for later in range(3) for start in starts]
        count = len(starts)
        return [
            max(horizon[begin + q] - horizon[begin] + floods[(begin + q) % count] for begin in range(count))
            for q in range(1, count + 1)
        ]

    def flood_ns(self, offset: int, *, span: int) -> int:
        """The duration of a flood of `span` turns from the `offset`-th on, contention windows in between included."""
        return (
            self.start_ns(offset + span - 1, frame_start_ns=0) + self.turn_ns - self.start_ns(offset, frame_start_ns=0)
        )


def turn_slack_ns(scenario: Scenario) -> int:
    """What a turn is longer than its largest frame: also how far the clocks of two nodes may be apart."""
    return round(scenario.clusters.turn_slack_us * US)


def turn_ns(scenario: Scenario, *, payload_bytes: int) -> int:
    """The length of a turn for frames of this size; the slack is for flight, detection and clock errors."""
    radio = scenario.radio
    timing = Timing.of(radio)
    frame_ns = airtime_ns(payload_bytes + OVERHEAD_BYTES, radio, rate_mbps=radio.rate_mbps)
    return frame_ns + timing.difs_ns + radio.cw_min * timing.slot_ns + turn_slack_ns(scenario)


def receipt_ns(scenario: Scenario) -> int:
    """The longest time from the end of a frame to the application that it is for: the handover of receptions, and one
    lead, because a lead is how late a process may be woken.
    """
    return scenario.radio.handover_ns + scenario.radio.lead_ns


def clocks_fit(scenario: Scenario, *, clock_error_ns: int) -> bool:
    """True if turns stay apart when no clock is farther than this from the swarm's; exact clocks always fit.

    Where clocks are not exact, an error of 0 is one that the node has not heard of yet; the greatest that hellos state
    may be any greater one.
    """
    if not clock_error_ns:
        return not scenario.clock.modelled
    if scenario.clock.sync == "beacons" and clock_error_ns >= MOST_STATED_NS:
        return False
    return least_slack_ns(clock_error_ns) <= turn_slack_ns(scenario)


def least_slack_ns(clock_error_ns: int) -> int:
    """The slack that keeps turns apart when no clock is farther than this from the swarm's."""
    return 2 * clock_error_ns + _FLIGHT_NS
