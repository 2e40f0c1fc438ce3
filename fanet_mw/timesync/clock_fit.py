"""Swarm time as a line over the own clock, fitted to pairs (own instant, how far swarm time is ahead then).

    swarm - own = offset + rate x (own - at)       weighted least squares over the last pairs (FTSP, Maroti et al. 2004)

Each pair comes with a bound of its error; a pair that lies beyond that and the line's own is counted and left out. When
more pairs of the window agree against the line than for it, the line was wrong: it starts anew from them. The error
that is stated is an estimate, not a proof: four standard deviations of the fit, on top of what the pairs state.
"""

import math
from collections import deque
from typing import Final, NamedTuple

from fanet_mw.units import S

PAIRS: Final = 32
WINDOW_NS: Final = 30 * S
"""Pairs older than this, or beyond this many, are forgotten: rates wander."""
_SIGMAS: Final = 4.0
_AGREEING: Final = 2
"""So many pairs at least overthrow a line."""


class Pair(NamedTuple):
    """At the own instant `local_ns` swarm time was ahead by `offset_ns`, give or take `error_ns`."""

    local_ns: int
    offset_ns: int
    error_ns: int
    rate: float = 0.0
    """How fast that error may have grown since, as whoever said it states (parts)."""


class Oscillator(NamedTuple):
    """What a node knows of its own clock and of those it follows."""

    rate: float
    """Bound by which two clocks may run apart (parts, not ppm)."""
    wander: float
    """Standard deviation by which a rate changes in a second (parts)."""
    stamp_ns: int
    """Resolution of time stamps."""


class Line(NamedTuple):
    """The fit, and how well it is known."""

    at_ns: int
    offset_ns: int
    rate: float
    stated_ns: float
    """What the pairs state as their error, by weight; of the last one, if that is more."""
    offset_sd_ns: float
    rate_sd: float
    last_ns: int = 0
    stated_rate: float = 0.0
    """What is stated of the rate they all follow: what may have grown since the last of them."""

    def offset_at(self, local_ns: int) -> int:
        return self.offset_ns + round((local_ns - self.at_ns) * self.rate)

    def swarm_ns(self, local_ns: int) -> int:
        """Swarm time when the own clock shows `local_ns`."""
        return local_ns + self.offset_at(local_ns)

    def local_ns(self, swarm_ns: int) -> int:
        """What the own clock shows at that swarm time."""
        beyond_ns = swarm_ns - self.at_ns - self.offset_ns
        return self.at_ns + beyond_ns - round(beyond_ns * (self.rate / (1 + self.rate)))

    def error_ns(self, local_ns: int, oscillator: Oscillator) -> int:
        """The stated bound of the error at an instant."""
        far_ns = abs(local_ns - self.at_ns)
        drift_ns = min(oscillator.rate, _SIGMAS * self.rate_sd) * far_ns
        drift_ns += min(oscillator.rate, self.stated_rate) * abs(local_ns - self.last_ns)
        wander_ns = (
            _SIGMAS * oscillator.wander * math.sqrt(2 / S) * math.pow(far_ns, 1.5)
        )  # of both clocks, a random walk
        return math.ceil(self.stated_ns + _SIGMAS * self.offset_sd_ns + drift_ns + wander_ns)

    def rate_error(self, oscillator: Oscillator) -> float:
        """The stated bound of the error of the rate (parts)."""
        return min(oscillator.rate, self.stated_rate + _SIGMAS * self.rate_sd)


EXACT: Final = Line(0, 0, 0.0, 0.0, 0.0, 0.0)
"""The own clock is swarm time."""


def fitted(pairs: list[Pair], oscillator: Oscillator) -> Line:
    """The line of at least one pair; a pair weighs by the square of how well it is known."""
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
    slope_ns = max(sigma_ns, stated_ns / count**2)  # few pairs: what they state may be a slope too
    effective = whole * whole / math.fsum(w * w for w in weights)
    middle_ns = at_ns + round(mean_x)
    return Line(
        at_ns=middle_ns,
        offset_ns=base_ns + round(mean_y),
        rate=rate,
        stated_ns=max(stated_ns, pairs[-1].error_ns),
        offset_sd_ns=sigma_ns / math.sqrt(effective),
        rate_sd=slope_ns / math.sqrt(spread * effective) if spread > 0 else math.inf,
        last_ns=at_ns,
        stated_rate=pairs[-1].rate,
    )


class ClockFit:
    """One node's line, and the pairs for and against it."""

    def __init__(self, oscillator: Oscillator) -> None:
        self._oscillator = oscillator
        self._pairs: deque[Pair] = deque(maxlen=PAIRS)
        self._against: deque[Pair] = deque(maxlen=PAIRS + 1)
        self.line: Line | None = None
        self.outliers = 0
        """Pairs left out."""
        self.steps = 0
        """Times the line was overthrown."""

    def __len__(self) -> int:
        return len(self._pairs)

    def add(self, pair: Pair) -> bool:
        """Take in a pair; returns whether it is believed."""
        horizon_ns = pair.local_ns - WINDOW_NS
        while self._against and self._against[0].local_ns < horizon_ns:
            self._against.popleft()
        if self.line is None or self.agrees(pair):
            self._keep([*(old for old in self._pairs if old.local_ns >= horizon_ns), pair])
            return True
        self.outliers += 1
        self._against.append(pair)
        together = [other for other in self._against if self._alike(other, pair)]
        for_it = sum(1 for old in self._pairs if old.local_ns >= horizon_ns)
        if len(together) < _AGREEING or len(together) <= for_it:
            return False
        self.steps += 1
        self._against.clear()
        self._keep(together)
        return True

    def _keep(self, pairs: list[Pair]) -> None:
        self._pairs = deque(pairs, maxlen=PAIRS)
        self.line = fitted(list(self._pairs), self._oscillator)

    def agrees(self, pair: Pair) -> bool:
        """Whether a pair is where the line may be, both errors counted."""
        assert self.line is not None, "only a line can be agreed with"
        apart_ns = abs(pair.offset_ns - self.line.offset_at(pair.local_ns))
        margin_ns = self.line.error_ns(pair.local_ns, self._oscillator) + pair.error_ns
        return apart_ns <= margin_ns + 2 * self._oscillator.stamp_ns

    def _alike(self, one: Pair, other: Pair) -> bool:
        """Whether two pairs may be of one line, whichever."""
        drift_ns = self._oscillator.rate * abs(one.local_ns - other.local_ns)
        margin_ns = one.error_ns + other.error_ns + 2 * self._oscillator.stamp_ns
        return abs(one.offset_ns - other.offset_ns) <= drift_ns + margin_ns

    def settle(self, line: Line) -> None:
        """From now on this line, whatever the pairs said."""
        self._pairs.clear()
        self._against.clear()
        self.line = line
