"""The geometry of a superframe with collision-free floods: a contention window, then equal turns. Pure functions of
time.

    origin                                            origin + period
    | contention window | turn 0 | turn 1 | ... | rest | contention window | ...

A turn has room for one frame, the DIFS before it, and the longest backoff that an earlier frame may have left behind,
so any 802.11 MAC can start the frame when its turn begins. Everything else (hellos, joins, unicasts to a head, repairs)
contends in the window.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from fanet_mw.airtime import OVERHEAD_BYTES, Timing, airtime_ns
from fanet_mw.scenario import Scenario
from fanet_mw.timesync.ftsp import MOST_STATED_NS
from fanet_mw.units import MS, US

_FLIGHT_NS: Final = 20 * US
"""The propagation delay over 6 km; this part of the slack is not available for clock errors."""
_TAIL_NS: Final = 5 * MS
"""In this last part of the contention window no frame may start, because it must be over when the turns begin."""


class Turns(NamedTuple):
    """The geometry of a superframe: its contention window, and the turns of equal length after it."""

    origin_ns: int
    period_ns: int
    contention_ns: int
    turn_ns: int
    per_frame: int

    def frame_start_ns(self, t_ns: int) -> int:
        """The beginning of the superframe in which an instant lies."""
        return t_ns - (t_ns - self.origin_ns) % self.period_ns

    def start_ns(self, offset: int, *, frame_start_ns: int) -> int:
        """The start of turn number `offset`, counted from the beginning of a superframe; it may lie in a later
        superframe.
        """
        later, turn = divmod(offset, self.per_frame)
        return frame_start_ns + later * self.period_ns + self.contention_ns + turn * self.turn_ns

    def turn_at(self, t_ns: int) -> int | None:
        """The turn in which an instant lies; None in the contention window and in the rest."""
        phase_ns = (t_ns - self.origin_ns) % self.period_ns - self.contention_ns
        turn = phase_ns // self.turn_ns
        return turn if phase_ns >= 0 and turn < self.per_frame else None

    def next_start_ns(self, offsets: Sequence[int], *, not_before_ns: int) -> int:
        """The first start, at or after an instant, of a turn with one of these offsets (ascending, in every
        superframe).
        """
        frame_ns = self.frame_start_ns(not_before_ns)
        for frame_start_ns in (frame_ns, frame_ns + self.period_ns):
            for offset in offsets:
                start_ns = self.start_ns(offset, frame_start_ns=frame_start_ns)
                if start_ns >= not_before_ns:
                    return start_ns
        raise AssertionError("offsets are turns of one superframe, so one of the next lies ahead")

    def contending_ns(self, start_ns: int, random: Callable[[], float]) -> int:
        """The instant from which a frame that is due at `start_ns` may contend: at once if a window is open, otherwise
        at a random instant of the next one.
        """
        open_ns = max(1, self.contention_ns - _TAIL_NS)
        frame_ns = self.frame_start_ns(start_ns)
        if start_ns - frame_ns < open_ns:
            return start_ns
        return frame_ns + self.period_ns + int(random() * open_ns)

    def worst_ns(self, roots: Sequence[int], *, span: int, interval_ns: int, together: int = 1) -> int | None:
        """A sound bound of the delay of packets that come at least `interval_ns` apart, from their generation to all
        nodes.

        Each root turn lets out as many waiting packets as there are, up to `together`. The q-th packet of a busy period
        that begins just after a root turn is let out in the ceil(q / together)-th turn after it, because a turn that
        lets out fewer ends the period; `flood_ns` later all nodes have it. The bound is the maximum over all q of the
        busy period, and over all turns after which it may begin (Davis et al., 2007); of packets that are let out
        together, the first has waited longest. None if more packets come than are let out. The bound holds as long as
        the swarm stays as it was when the timetable was made, no frame is lost, and nothing of higher priority uses the
        same root turns.
        """
        if together * len(roots) * interval_ns < self.period_ns:
            return None
        done_ns = self.done_ns(roots, span=span)
        return max(done - later * together * interval_ns for later, done in enumerate(done_ns))

    def done_ns(self, roots: Sequence[int], *, span: int) -> list[int]:
        """The longest time from just after one of these turns until all nodes have what the q-th turn after it lets
        out.

        It is given for each q from 1 to the number of turns in a superframe.
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
        """The duration of a flood of `span` turns from turn `offset` on, including contention windows in between."""
        return (
            self.start_ns(offset + span - 1, frame_start_ns=0) + self.turn_ns - self.start_ns(offset, frame_start_ns=0)
        )


def turn_slack_ns(scenario: Scenario) -> int:
    """The time by which a turn is longer than its largest frame; it also bounds how far two clocks may be apart."""
    return round(scenario.clusters.turn_slack_us * US)


def turn_ns(scenario: Scenario, *, payload_bytes: int) -> int:
    """The length of a turn for frames of this size. The slack covers propagation, detection and clock errors."""
    radio = scenario.radio
    timing = Timing.of(radio)
    frame_ns = airtime_ns(payload_bytes + OVERHEAD_BYTES, radio, rate_mbps=radio.rate_mbps)
    return frame_ns + timing.difs_ns + radio.cw_min * timing.slot_ns + turn_slack_ns(scenario)


def receipt_ns(scenario: Scenario) -> int:
    """The longest time from the end of a frame until the application has it: the handover of the reception, and one
    lead, because a process may be woken up to one lead late.
    """
    return scenario.radio.handover_ns + scenario.radio.lead_ns


def clocks_fit(scenario: Scenario, *, clock_error_ns: int) -> bool:
    """True if turns stay apart when each clock is within this error of swarm time.

    If clocks are not exact, an error of 0 means that the node has not heard of any error yet, so the answer is False.
    """
    if not clock_error_ns:
        return not scenario.clock.modelled
    if scenario.clock.sync == "beacons" and clock_error_ns >= MOST_STATED_NS:
        return False
    return least_slack_ns(clock_error_ns) <= turn_slack_ns(scenario)


def least_slack_ns(clock_error_ns: int) -> int:
    """The slack that keeps turns apart when each clock is within this error of swarm time."""
    return 2 * clock_error_ns + _FLIGHT_NS
