"""Statistics of the air from the end of the warm-up to the beginning of the drain."""

from typing import NamedTuple

import numpy as np

from emulator.kernel import state as s
from fanet_mw.units import S


class Sample(NamedTuple):
    """The counters of the air at an instant."""

    g: s.Ints
    """The kernel's globals, copied."""
    busy_ns: int
    """The time for which the PHY was not idle, summed over all stations."""
    delivered_bytes: int
    now_ns: int


class Measurement:
    """The difference of two samples."""

    def __init__(self, window_ns: tuple[int, int], *, max_attempts: int) -> None:
        """`window_ns`: the instants at which the measurement begins and ends."""
        self._max_attempts = max_attempts
        self._begins_ns: int | None = window_ns[0]
        self._ends_ns: int | None = window_ns[1]
        self._first = Sample(np.zeros(s.GLOBALS, np.int64), 0, 0, 0)
        self._last: Sample | None = None

    def next_ns(self) -> int | None:
        """The instant at which the measurement begins or, when it has begun, ends; None when it is over."""
        return self._ends_ns if self._begins_ns is None else self._begins_ns

    def pass_time(self, due_ns: int, now: Sample) -> None:
        """Take the samples that are due by this instant."""
        if self._begins_ns is not None and self._begins_ns <= due_ns:
            self._first, self._begins_ns = now, None
        if self._ends_ns is not None and self._ends_ns <= due_ns:
            self._last, self._ends_ns = now, None

    def report(self, now: Sample, *, stations: int) -> dict[str, float | int | None]:
        """The statistics from the beginning to the end of the measurement, or until now if it has not ended."""
        first, last = self._first, self._last or now
        d = (last.g - first.g).tolist()
        span_ns = max(1, last.now_ns - first.now_ns)
        landed = sum(d[s.RECEIVED_COPIES : s.CUT_COPIES + 1])
        payload_bits = 8 * (last.delivered_bytes - first.delivered_bytes)
        return {
            "pdr": _ratio(d[s.RECEIVED_COPIES], landed),
            "busy": round((last.busy_ns - first.busy_ns) / (span_ns * stations), 6),
            "mean_retries": self._mean_retries(d),
            "attempt_failure": _ratio(d[s.ATTEMPTS_FAILED], d[s.ATTEMPTS_MADE]),
            "late_acks": d[s.LATE_ACKS],
            "throughput_mbps": round(payload_bits / (span_ns / S) / 1e6, 6),
        }

    def _mean_retries(self, d: list[int]) -> float | None:
        """How often a unicast that does not expire is repeated, by E. L. Kaplan and P. Meier, J. Am. Stat. Assoc. 53,
        1958; frames that expire count for the attempts that they made.
        """
        if not d[s.MADE_BY]:
            return None
        mean, failed = 0.0, 1.0
        for retry in range(min(self._max_attempts - 1, 255)):
            row = min(retry, s.ATTEMPT_ROWS - 1)
            made = d[s.MADE_BY + row]
            failed *= min(1.0, d[s.FAILED_BY + row] / made) if made else 0.0
            mean += failed
        return round(mean, 6)


def _ratio(part: int, whole: int) -> float | None:
    return round(part / whole, 6) if whole else None
