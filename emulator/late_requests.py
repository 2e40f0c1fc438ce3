"""Late requests: those that come to the medium after the instant at which their frame was to start.

Each is counted, and its frame starts at once, but above `TOO_LATE_NS` it is dropped. The moments in which they came are
counted, too: after a pause of the machine they are few, in an overload all.
"""

from typing import Final

from fanet_mw.units import MS

TOO_LATE_NS: Final = 50 * MS
"""A request that is later than this is dropped, because its slot belongs to another node by then."""
MOMENT_NS: Final = 25 * MS
"""The length of a moment in swarm time when the swarm's clock runs at 1."""
_STEPS: Final = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
"""The upper edges of the bins of the histogram [ms]; a percentile is stated as the upper edge of its bin."""


def moment_ns(time_scale: float) -> int:
    return max(1, round(MOMENT_NS * time_scale))


class LateRequests:
    """The number of late requests, and a histogram of how late they were."""

    def __init__(self, *, time_scale: float) -> None:
        self.close = 0
        """The number of requests that came in time, but in the last quarter of their lead."""
        self._count = 0
        self._most_ns = 0
        self._sum_ns = 0
        self._moment_ns = moment_ns(time_scale)
        self._moments = 0
        self._last_moment = -1
        self._histogram = [0] * (len(_STEPS) + 1)

    def is_too_late(self, late_ns: int, *, now_ns: int) -> bool:
        """Count a request that comes `late_ns` late; returns True if it is to be dropped."""
        self._count += 1
        self._most_ns = max(self._most_ns, late_ns)
        self._sum_ns += late_ns
        moment = now_ns // self._moment_ns
        self._moments += moment != self._last_moment
        self._last_moment = moment
        late_ms = late_ns / MS
        index = next((i for i, edge in enumerate(_STEPS) if late_ms <= edge), len(_STEPS))
        self._histogram[index] += 1
        return late_ns > TOO_LATE_NS

    def report(self, requests: int) -> dict[str, float]:
        """The lateness of all requests; one that was in time counts as 0 ms."""
        return {
            "late_frames": self._count,
            "frames": requests,
            "close_frames": self.close,
            "late_moments": self._moments,
            "sum_ms": round(self._sum_ns / MS, 3),
            "p50_ms": self._percentile(0.5, requests),
            "p99_ms": self._percentile(0.99, requests),
            "max_ms": round(self._most_ns / MS, 3),
        }

    def _percentile(self, share: float, requests: int) -> float:
        wanted = share * requests
        seen = requests - self._count
        if seen >= wanted:
            return 0.0
        for index, count in enumerate(self._histogram):
            seen += count
            if seen >= wanted and index < len(_STEPS):
                return float(_STEPS[index])
        return round(self._most_ns / MS, 3)
