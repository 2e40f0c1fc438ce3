"""A histogram of durations with logarithmic bins: constant memory, and percentiles with an error of at most a tenth.

Real-time hosts keep their lateness in one (`wake_lateness.py`).
"""

import math
from typing import Final

from fanet_mw.units import MS

_PER_DECADE: Final = 24
_LEAST_NS: Final = 1_000


class DurationHistogram:
    """A histogram of durations [ns]."""

    def __init__(self) -> None:
        self._bins: dict[int, int] = {}
        self.count = 0
        self.max_ns = 0

    def add(self, duration_ns: int) -> None:
        self.count += 1
        self.max_ns = max(self.max_ns, duration_ns)
        index = 0 if duration_ns <= _LEAST_NS else 1 + int(_PER_DECADE * math.log10(duration_ns / _LEAST_NS))
        self._bins[index] = self._bins.get(index, 0) + 1

    def percentile_ns(self, share: float) -> int:
        """The upper edge of the bin at which this share of all durations is reached; 0 if there are none."""
        wanted, seen = share * self.count, 0
        for index in sorted(self._bins):
            seen += self._bins[index]
            if seen >= wanted:
                return min(self.max_ns, round(_LEAST_NS * math.pow(10.0, index / _PER_DECADE)))
        return 0

    def summary(self) -> dict[str, float]:
        """The 50th and 99th percentile and the maximum [ms], and the count."""
        return {
            "p50": round(self.percentile_ns(0.5) / MS, 3),
            "p99": round(self.percentile_ns(0.99) / MS, 3),
            "max": round(self.max_ns / MS, 3),
            "count": self.count,
        }
