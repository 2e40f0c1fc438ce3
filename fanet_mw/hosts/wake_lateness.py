"""How late a real-time host woke its actor, and for how long it stood still, in swarm time: both go into the actor's
report.
"""

import math
import resource
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from fanet_mw.units import MS

_PER_DECADE: Final = 24
_LEAST_NS: Final = 1_000


class DurationHistogram:
    """A histogram of durations [ns] with logarithmic bins: constant memory, and percentiles to a tenth."""

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


class WakeLateness:
    """The lateness of one host since its start."""

    def __init__(self) -> None:
        self._lateness = DurationHistogram()
        self._asked_past_ns = 0
        self._stall_ns = 0

    def asked(self, wake_ns: int, *, call_ns: int) -> None:
        """The actor has asked for a wake-up at `wake_ns`, during a call for the instant `call_ns`."""
        self._asked_past_ns = max(self._asked_past_ns, call_ns - wake_ns)

    def woken(self, late_ns: int) -> None:
        self._lateness.add(late_ns)
        self.stalled(late_ns)

    def stalled(self, for_ns: int) -> None:
        """The event loop did nothing for this long, in swarm time, although it should have."""
        self._stall_ns = max(self._stall_ns, for_ns)

    def summary(self) -> Mapping[str, object]:
        return {
            "wake_lateness_ms": self._lateness.summary(),
            "asked_past_ms": round(self._asked_past_ns / MS, 3),
            "stall_ms": round(self._stall_ns / MS, 3),
        }


class ProcessCost:
    """The cost of one process."""

    def __init__(self) -> None:
        self.puts = 0

    def summary(self, *, final: bool) -> Mapping[str, object]:
        usage = resource.getrusage(resource.RUSAGE_SELF)
        return {
            "cpu_s": round(usage.ru_utime + usage.ru_stime, 3),
            "uss_mb": uss_mb() if final else None,  # reading it delays the process by more than a millisecond
            "puts": self.puts,
        }


def uss_mb() -> float | None:
    """The memory that only this process uses [MB]; None if /proc does not tell."""
    try:
        text = Path("/proc/self/smaps_rollup").read_text(encoding="ascii")
    except OSError:
        return None
    private = [line.split()[1] for line in text.splitlines() if line.startswith("Private_")]
    return round(sum(int(kb) for kb in private) / 1024, 2)
