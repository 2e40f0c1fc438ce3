"""Means over seeds with 95 % intervals.

From eight seeds on an interval is that of the bootstrap, by percentiles that are expanded for few values (T. C.
Hesterberg, "What Teachers Should Know About the Bootstrap", The American Statistician 69(4), 2015), with resamples of a
fixed seed. With fewer seeds it would hold the mean far less often than it says; there it is Student's t, cut where the
quantity ends, which takes nothing from its confidence.
"""

import functools
import math
import statistics
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

_T_975: Final = (
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131,
    2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
)  # fmt: skip
"""Quantile 0.975 of Student's t for 1 to 30 degrees of freedom."""
_NORMAL_975: Final = 1.960
_IN_FULL: Final = 999.5
_BOOTSTRAP_FROM: Final = 8
"""The number of values from which on the bootstrap is used."""
_RESAMPLES: Final = 20_000
_SEED: Final = 1


class Possible(NamedTuple):
    """The least and the greatest value that a quantity can have."""

    least: float = -math.inf
    most: float = math.inf


ANY: Final = Possible()
SHARE: Final = Possible(0.0, 1.0)
DISTANCE: Final = Possible(0.0)
"""Of what is never negative: a time, a number, the size of a difference."""


class Interval(NamedTuple):
    """A mean over independent runs, and the interval in which the true mean lies with 95 % confidence."""

    mean: float
    low: float
    high: float
    runs: int

    def scaled(self, factor: float) -> "Interval":
        return Interval(self.mean * factor, self.low * factor, self.high * factor, self.runs)

    def plain(self) -> dict[str, float | None]:
        """As JSON and tables hold it: of one run there are no ends, of none there is no mean."""
        known = {"mean": self.mean, "low": self.low, "high": self.high}
        return {name: value if math.isfinite(value) else None for name, value in known.items()} | {"seeds": self.runs}

    def text(self, unit: str = "") -> str:
        """The interval as text, for example `0.91 s [0.88, 0.94]`."""
        unit = f" {unit}" if unit else ""
        if self.runs == 0:
            return "no run"
        if self.runs == 1:
            return f"{_said(self.mean)}{unit} [one run]"
        return f"{_said(self.mean)}{unit} [{_said(self.low)}, {_said(self.high)}]"


def _said(value: float) -> str:
    """A number with three digits; usual numbers are written without a power of ten."""
    return f"{value:.0f}" if _IN_FULL <= abs(value) < math.inf else f"{value:.3g}"


def quantile_975(freedom: int) -> float:
    """The quantile of Student's t; beyond the table it is interpolated towards the normal one, by 1/freedom."""
    if freedom <= len(_T_975):
        return _T_975[freedom - 1]
    last = len(_T_975)
    return _NORMAL_975 + (_T_975[-1] - _NORMAL_975) * last / freedom


def interval(values: Sequence[float], possible: Possible = ANY) -> Interval:
    """The interval of one value per run: of one run all that is possible, of none NaN as well."""
    if not values:
        return Interval(math.nan, *possible, 0)
    mean = math.fsum(values) / len(values)
    if len(values) == 1:
        return Interval(mean, *possible, 1)
    low, high = _by_bootstrap(values) if len(values) >= _BOOTSTRAP_FROM else _by_student(values, mean)
    return Interval(mean, max(possible.least, low), min(possible.most, high), len(values))


def _by_student(values: Sequence[float], mean: float) -> tuple[float, float]:
    half = quantile_975(len(values) - 1) * statistics.stdev(values, mean) / math.sqrt(len(values))
    return mean - half, mean + half


def _by_bootstrap(values: Sequence[float]) -> tuple[float, float]:
    """The percentiles of the means of resamples, at the levels that give Student's interval of normal values."""
    count = len(values)
    if min(values) == max(values):
        return values[0], values[0]
    tail = statistics.NormalDist().cdf(-math.sqrt(count / (count - 1)) * quantile_975(count - 1))
    means = _resamples(count) @ np.asarray(values) / count
    low, high = np.quantile(means, [tail, 1 - tail])
    return max(min(values), float(low)), min(max(values), float(high))


@functools.cache
def _resamples(count: int) -> NDArray[np.float64]:
    """How often each of this many values is in each resample."""
    drawn = np.random.default_rng(_SEED).integers(count, size=(_RESAMPLES, count))
    return np.stack([np.count_nonzero(drawn == value, axis=1) for value in range(count)], axis=1).astype(np.float64)
