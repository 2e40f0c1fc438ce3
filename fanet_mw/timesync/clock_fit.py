"""Fits swarm time as a line over a node's own clock: each data point (pair) states how far swarm time was ahead of the
clock.

    swarm - own = offset + rate x (own - at)       weighted least squares over the last pairs (FTSP, Maroti et al. 2004)

A pair farther from the line than both stated errors is an outlier. If more pairs in the window agree against the line
than support it, it is fitted anew to them, which no single neighbor achieves against others. The stated error is an
estimate: four standard deviations of the fit, plus the pairs' errors.
"""

import math
from collections import deque
from typing import Final, NamedTuple

from fanet_mw.units import S

PAIRS: Final = 32
"""The number of pairs that are kept, the latest ones."""
WINDOW_NS: Final = 30 * S
"""Older pairs are dropped, because rates wander."""
_SIGMAS: Final = 4.0
_AGREEING: Final = 2
"""At least this many agreeing pairs are needed to replace a line."""


class Pair(NamedTuple):
    """At the own instant `local_ns` swarm time was ahead by `offset_ns`, with an error of at most `error_ns`."""

    local_ns: int
    offset_ns: int
    error_ns: int
    rate: float = 0.0
    """The rate at which that error may have grown since, as the sender of the pair has stated (parts)."""
    source: int = 0
    """The node that has stated the pair."""


class Oscillator(NamedTuple):
    """What a node knows of its own clock and of the clocks that it follows."""

    rate: float
    """A bound of the rate at which two clocks may run apart (parts, not ppm)."""
    wander: float
    """The standard deviation of the change of a rate in one second (parts)."""
    stamp_ns: int
    """The resolution of time stamps."""


class Line(NamedTuple):
    """A fitted line, and how accurate it is."""

    at_ns: int
    offset_ns: int
    rate: float
    stated_ns: float
    """The weighted mean of the errors that the pairs state, or that of the last pair if it is greater."""
    offset_sd_ns: float
    rate_sd: float
    last_ns: int = 0
    stated_rate: float = 0.0
    """The rate error that the last pair states: how fast the error may have grown since that pair."""

    def offset_at(self, local_ns: int) -> int:
        return self.offset_ns + round((local_ns - self.at_ns) * self.rate)

    def swarm_ns(self, local_ns: int) -> int:
        return local_ns + self.offset_at(local_ns)

    def local_ns(self, swarm_ns: int) -> int:
        beyond_ns = swarm_ns - self.at_ns - self.offset_ns
        return self.at_ns + beyond_ns - round(beyond_ns * (self.rate / (1 + self.rate)))

    def error_ns(self, local_ns: int, oscillator: Oscillator) -> int:
        """The bound of the line's error at an instant, as the node states it to others."""
        far_ns = abs(local_ns - self.at_ns)
        drift_ns = min(oscillator.rate, _SIGMAS * self.rate_sd) * far_ns
        drift_ns += min(2 * oscillator.rate, self.stated_rate) * abs(local_ns - self.last_ns)
        # the rates of both clocks are random walks
        wander_ns = _SIGMAS * oscillator.wander * math.sqrt(2 / S) * math.pow(far_ns, 1.5)
        return math.ceil(self.stated_ns + _SIGMAS * self.offset_sd_ns + drift_ns + wander_ns)

    def rate_error(self, oscillator: Oscillator) -> float:
        """The bound of the rate's error (parts), as the node states it to others."""
        most = oscillator.rate + abs(self.rate)  # the true rate may be the greatest one of the other sign
        return min(most, self.stated_rate + _SIGMAS * self.rate_sd)


def alike(one: Pair, other: Pair, oscillator: Oscillator) -> bool:
    """True if both pairs may belong to the same line."""
    drift_ns = oscillator.rate * abs(one.local_ns - other.local_ns)
    margin_ns = one.error_ns + other.error_ns + 2 * oscillator.stamp_ns
    return abs(one.offset_ns - other.offset_ns) <= drift_ns + margin_ns


def _is_one_against_others(against: list[Pair], for_it: list[Pair]) -> bool:
    """True if a single source contradicts several others."""
    sources = {pair.source for pair in against}
    return len(sources) == 1 and any(pair.source not in sources for pair in for_it)


EXACT: Final = Line(0, 0, 0.0, 0.0, 0.0, 0.0)
"""The line of a node whose own clock is swarm time."""


def fitted(pairs: list[Pair], oscillator: Oscillator) -> Line:
    at_ns, base_ns = pairs[-1].local_ns, pairs[-1].offset_ns
    count, floor_ns = len(pairs), max(1.0, oscillator.stamp_ns / 2)
    weights = [1 / (pair.error_ns + floor_ns) ** 2 for pair in pairs]
    whole = math.fsum(weights)
    mean_x = math.fsum(w * (p.local_ns - at_ns) for w, p in zip(weights, pairs, strict=True)) / whole
    mean_y = math.fsum(w * (p.offset_ns - base_ns) for w, p in zip(weights, pairs, strict=True)) / whole
    stated_ns = math.fsum(w * p.error_ns for w, p in zip(weights, pairs, strict=True)) / whole
    points = [
        (w, p.local_ns - at_ns - mean_x, p.offset_ns - base_ns - mean_y) for w, p in zip(weights, pairs, strict=True)
    ]
    spread = math.fsum(w * x * x for w, x, _ in points) / whole
    rate = math.fsum(w * x * y for w, x, y in points) / whole / spread if spread > 0 else 0.0
    rate = max(-oscillator.rate, min(oscillator.rate, rate))
    residual = math.fsum(w * (y - rate * x) ** 2 for w, x, y in points) / whole
    free = count / (count - 2) if count > 2 else 1.0
    sigma_ns = max(floor_ns, math.sqrt(residual * free))
    slope_ns = max(sigma_ns, stated_ns / count**2)  # with few pairs, their stated errors may also cause a slope
    effective = whole * whole / math.fsum(w * w for w in weights)
    rate_sd = slope_ns / math.sqrt(spread * effective) if spread > 0 else math.inf
    if _SIGMAS * rate_sd >= oscillator.rate:
        rate = 0.0  # a rate of the wrong sign is off by up to twice the oscillator's greatest, 0 by once that
    middle_ns = at_ns + round(mean_x)
    return Line(
        at_ns=middle_ns,
        offset_ns=base_ns + round(mean_y),
        rate=rate,
        stated_ns=max(stated_ns, pairs[-1].error_ns),
        offset_sd_ns=sigma_ns / math.sqrt(effective),
        rate_sd=rate_sd,
        last_ns=at_ns,
        stated_rate=pairs[-1].rate,
    )


class ClockFit:
    """A node's line, the pairs that support it, and those that contradict it."""

    def __init__(self, oscillator: Oscillator) -> None:
        self._oscillator = oscillator
        self._pairs: deque[Pair] = deque(maxlen=PAIRS)
        self._against: deque[Pair] = deque(maxlen=PAIRS + 1)
        self.line: Line | None = None
        self.outliers = 0
        self.steps = 0
        """The number of times that contradicting pairs have replaced the line."""

    def __len__(self) -> int:
        return len(self._pairs)

    def add(self, pair: Pair) -> bool:
        """Add a pair; returns True if it is accepted."""
        horizon_ns = pair.local_ns - WINDOW_NS
        while self._against and self._against[0].local_ns < horizon_ns:
            self._against.popleft()
        if self.line is None or self.agrees(pair):
            self._keep([*(old for old in self._pairs if old.local_ns >= horizon_ns), pair])
            return True
        self.outliers += 1
        self._against.append(pair)
        together = [other for other in self._against if alike(other, pair, self._oscillator)]
        for_it = [old for old in self._pairs if old.local_ns >= horizon_ns]
        if len(together) < _AGREEING or not (self._outvotes(together, for_it) or self._is_ahead(together, pair)):
            return False
        self.steps += 1
        self._against.clear()
        self._keep(together)
        return True

    @staticmethod
    def _outvotes(together: list[Pair], for_it: list[Pair]) -> bool:
        return len(together) > len(for_it) and not _is_one_against_others(together, for_it)

    def _is_ahead(self, together: list[Pair], pair: Pair) -> bool:
        """True if several sources state a later time than the line, which nobody can do who repeats old frames."""
        assert self.line is not None, "only a line can be contradicted"
        several = len({other.source for other in together}) >= _AGREEING
        return several and pair.offset_ns > self.line.offset_at(pair.local_ns)

    def _keep(self, pairs: list[Pair]) -> None:
        self._pairs = deque(pairs, maxlen=PAIRS)
        self.line = fitted(list(self._pairs), self._oscillator)

    def agrees(self, pair: Pair) -> bool:
        """True if the pair is within both errors of the line."""
        assert self.line is not None, "only a line can be agreed with"
        apart_ns = abs(pair.offset_ns - self.line.offset_at(pair.local_ns))
        margin_ns = self.line.error_ns(pair.local_ns, self._oscillator) + pair.error_ns
        return apart_ns <= margin_ns + 2 * self._oscillator.stamp_ns

    def replace(self, line: Line) -> None:
        self._pairs.clear()
        self._against.clear()
        self.line = line
