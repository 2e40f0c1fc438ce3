"""The clock of a UAV whose computer also has a counter that nobody sets (CLOCK_MONOTONIC): a jump of the clock is seen
at the next input, counted, and taken out.

The counter runs by the same oscillator, so it tells nothing about the clock's rate. The radio stamps by the counter,
too, so that a stamp from before a jump is known as such.
"""

from typing import Final

from agents.clock.local_clock import LocalClock
from fanet_mw.units import US

_NOTICED_NS: Final = 50 * US
_SLEWED: Final = 500e-6
"""A smaller change between two inputs is not taken for a jump: adjtime(3) slews a clock by 500 ppm."""


class SteadyClock:
    """A clock without its jumps, as far as its counter shows them."""

    def __init__(self, clock: LocalClock) -> None:
        self._clock = clock
        self._ahead_ns: list[int] = []
        """How far the clock was ahead of the counter: at the last input, and at the last one before the last jump."""
        self._taken_out_ns = [0, 0]
        """The sum of all jumps, and that sum without the last one."""
        self._input_ns = 0
        self.jumps = 0

    def pass_time(self, true_ns: int, *, until_ns: int) -> None:
        self._clock.pass_time(true_ns, until_ns=until_ns)
        ahead_ns = self._clock.local_ns(true_ns) - self._clock.counter_ns(true_ns)
        if not self._ahead_ns:
            self._ahead_ns = [ahead_ns, ahead_ns]
        by_ns = ahead_ns - self._ahead_ns[0]
        if abs(by_ns) > _NOTICED_NS + _SLEWED * (true_ns - self._input_ns):
            self.jumps += 1
            self._taken_out_ns = [self._taken_out_ns[0] + by_ns, self._taken_out_ns[0]]
            self._ahead_ns[1] = self._ahead_ns[0]
        self._ahead_ns[0], self._input_ns = ahead_ns, true_ns

    def local_ns(self, true_ns: int) -> int:
        shown_ns = self._clock.local_ns(true_ns)
        if not self.jumps:
            return shown_ns
        ahead_ns = shown_ns - self._clock.counter_ns(true_ns)
        now_ns, before_ns = self._ahead_ns
        return shown_ns - self._taken_out_ns[abs(ahead_ns - now_ns) > abs(ahead_ns - before_ns)]

    def true_ns(self, local_ns: int) -> int:
        """The true instant at which the clock shows `local_ns`, by the counter."""
        return self._clock.counter_true_ns(local_ns + self._taken_out_ns[0] - self._ahead_ns[0])
