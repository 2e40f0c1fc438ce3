"""The simulated oscillator of a UAV: the time that its clock shows at a true instant, and the reverse.

    local = true + offset + sum over seconds of rate x time,   the rate a bounded random walk, constant within a second

Only the simulation knows it; the node itself does not. The first and the last rate of the walk continue before and
after it. From the instant of a jump (`clock.jumps`) on, the clock shows more or less by its length. Not modeled:
temperature, voltage and aging.
"""

from typing import Final, NamedTuple

from fanet_mw.rng import stream
from fanet_mw.scenario import Clock
from fanet_mw.units import MS, US, NodeId, S, seconds_to_ns

_PPM: Final = 1e-6
_NOTICED_NS: Final = 50 * US
_SLEWED: Final = 500e-6
"""A smaller change between two inputs is not taken for a jump: adjtime(3) slews a clock by 500 ppm."""
_AHEAD_NS: Final = 60 * S
"""The walk is computed this far ahead of the present, and nothing is announced farther ahead."""


class _Second(NamedTuple):
    """From this true instant on, the clock begins at `local_ns` and runs fast by `rate`."""

    true_ns: int
    local_ns: int
    rate: float


class LocalClock:
    """The clock of one node in one run."""

    def __init__(self, clock: Clock, *, seed: int, node: NodeId) -> None:
        random = stream(seed, "clock", node)
        self._offset_ns = round(random.uniform(-clock.offset_ns, clock.offset_ns))
        self._bound = clock.drift_ppm * _PPM
        self._wander = clock.wander_ppm * _PPM
        rate = random.uniform(-self._bound, self._bound)
        self._random = random
        self._jumps = _added_up(clock, node)
        self._now_ns = 0
        self._walk = [_Second(0, self._offset_ns, rate)]

    def pass_time(self, true_ns: int, *, until_ns: int) -> None:
        """Extend the walk over all instants that may be asked for from now on, at most up to `until_ns`."""
        self._now_ns = true_ns
        if not self._wander:
            return
        while self._walk[-1].true_ns < min(true_ns, until_ns) + _AHEAD_NS:
            last = self._walk[-1]
            rate = last.rate + self._random.gauss(0.0, self._wander)
            rate = max(-self._bound, min(self._bound, rate))
            self._walk.append(_Second(last.true_ns + S, _shown(last, last.true_ns + S), rate))

    def local_ns(self, true_ns: int) -> int:
        by_ns = next(by for at, by in reversed(self._jumps) if at is None or at <= true_ns)
        return self.counter_ns(true_ns) + by_ns

    def true_ns(self, local_ns: int) -> int:
        """The true instant of `local_ns`: of two, the first that is not past; of none, that of the jump."""
        shown = None
        for index, (at_ns, by_ns) in enumerate(self._jumps):
            until_ns = self._jumps[index + 1][0] if index + 1 < len(self._jumps) else None
            found_ns = self.counter_true_ns(local_ns - by_ns)
            if until_ns is not None and found_ns >= until_ns:
                shown = until_ns if shown is None else shown  # unless a later part shows it
                continue
            if at_ns is None or found_ns >= at_ns:
                shown = found_ns
                if found_ns >= self._now_ns:
                    break
        assert shown is not None, "the last part has no end, and the first one no beginning"
        return shown

    def counter_ns(self, true_ns: int) -> int:
        """The instant that the clock would show without jumps: what a counter shows that nobody sets."""
        index = max(0, min(len(self._walk) - 1, true_ns // S))
        return _shown(self._walk[index], true_ns)

    def counter_true_ns(self, local_ns: int) -> int:
        """The true instant at which the clock would show this without jumps."""
        index = max(0, min(len(self._walk) - 1, (local_ns - self._offset_ns) // S))
        while index and self._walk[index].local_ns > local_ns:
            index -= 1
        while index + 1 < len(self._walk) and self._walk[index + 1].local_ns <= local_ns:
            index += 1
        part = self._walk[index]
        elapsed_ns = local_ns - part.local_ns
        return part.true_ns + elapsed_ns - round(elapsed_ns * (part.rate / (1 + part.rate)))


def _added_up(clock: Clock, node: NodeId) -> list[tuple[int | None, int]]:
    """The parts of the time between the jumps of this node's clock: since when, and the sum of the jumps so far."""
    parts: list[tuple[int | None, int]] = [(None, 0)]
    for at_s, by_ms in sorted((at_s, by_ms) for jumper, at_s, by_ms in clock.jumps if jumper == node):
        parts.append((seconds_to_ns(at_s), parts[-1][1] + round(by_ms * MS)))
    return parts


def _shown(part: _Second, true_ns: int) -> int:
    elapsed_ns = true_ns - part.true_ns
    return part.local_ns + elapsed_ns + round(elapsed_ns * part.rate)


class SteadyClock:
    """A clock without its jumps, as far as a counter that nobody sets (CLOCK_MONOTONIC) shows them at the next input.

    The radio stamps by the counter, too, so that a stamp from before a jump is known as such.
    """

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
