"""Means over seeds with 95 % intervals (Student's t), and differences of pairs with the same seed."""

import math
import statistics
from collections.abc import Sequence
from typing import Final, NamedTuple

_T_975: Final = (
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131,
    2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
)  # fmt: skip
"""Quantile 0.975 of Student's t for 1 to 30 degrees of freedom."""
_NORMAL_975: Final = 1.960
_IN_FULL: Final = 999.5


class Interval(NamedTuple):
    """A mean over independent runs, and the interval in which the true mean lies with 95 % confidence."""

    mean: float
    low: float
    high: float
    runs: int

    def scaled(self, factor: float) -> "Interval":
        """The interval in another unit."""
        return Interval(self.mean * factor, self.low * factor, self.high * factor, self.runs)

    def text(self, unit: str = "") -> str:
        """The interval as text, for example `0.91 s [0.88, 0.94]`."""
        unit = f" {unit}" if unit else ""
        if math.isinf(self.low):
            return f"{_said(self.mean)}{unit} [one run]"
        return f"{_said(self.mean)}{unit} [{_said(self.low)}, {_said(self.high)}]"


def _said(value: float) -> str:
    """A number with three digits; usual numbers are written without a power of ten."""
    return f"{value:.0f}" if _IN_FULL <= abs(value) < math.inf else f"{value:.3g}"


def quantile_975(freedom: int) -> float:
    """The quantile of Student's t. Beyond 30 degrees of freedom it is interpolated between the table's last value and
    the normal quantile, by 1/freedom.
    """
    if freedom <= len(_T_975):
        return _T_975[freedom - 1]
    last = len(_T_975)
    return _NORMAL_975 + (_T_975[-1] - _NORMAL_975) * last / freedom


def interval(values: Sequence[float]) -> Interval:
    """The interval of one value per run; for a single run it is infinite, and without runs the mean is NaN."""
    if not values:
        return Interval(math.nan, -math.inf, math.inf, 0)
    mean = math.fsum(values) / len(values)
    if len(values) == 1:
        return Interval(mean, -math.inf, math.inf, 1)
    half = quantile_975(len(values) - 1) * statistics.stdev(values, mean) / math.sqrt(len(values))
    return Interval(mean, mean - half, mean + half, len(values))
