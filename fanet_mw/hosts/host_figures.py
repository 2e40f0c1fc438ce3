"""The figures of a real-time host in the report of its actor: how late it was, and what it cost."""

import resource
from pathlib import Path
from typing import Any

from fanet_mw.hosts.duration_histogram import DurationHistogram
from fanet_mw.units import MS


class HostFigures:
    """The figures of one host since its start."""

    def __init__(self) -> None:
        self.puts = 0
        """The number of puts on the bus."""
        self.unread = 0
        """The number of receptions that arrived after the end of the run."""
        self._lateness = DurationHistogram()
        self._asked_past_ns = 0
        self._stall_ns = 0

    def asked(self, wake_ns: int, *, call_ns: int) -> None:
        """The actor has asked for a wake-up at `wake_ns`, during a call for the instant `call_ns`."""
        self._asked_past_ns = max(self._asked_past_ns, call_ns - wake_ns)

    def woken(self, late_ns: int) -> None:
        """The actor was woken this long after it was due."""
        self._lateness.add(late_ns)
        self.stalled(late_ns)

    def stalled(self, for_ns: int) -> None:
        """The event loop did nothing for this long although it should have."""
        self._stall_ns = max(self._stall_ns, for_ns)

    def summary(self, *, final: bool) -> dict[str, Any]:
        """The figures, by their names in a report."""
        usage = resource.getrusage(resource.RUSAGE_SELF)
        return {
            "wake_lateness_ms": self._lateness.summary(),
            "asked_past_ms": round(self._asked_past_ns / MS, 3),
            "stall_ms": round(self._stall_ns / MS, 3),
            "cpu_s": round(usage.ru_utime + usage.ru_stime, 3),
            "uss_mb": uss_mb() if final else None,  # reading it delays the process by more than a millisecond
            "unread_receptions": self.unread,
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
