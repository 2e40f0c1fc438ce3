"""How late a real-time host woke its actor, and for how long it stood still; both go into the actor's report."""

from collections.abc import Mapping

from fanet_mw.hosts.duration_histogram import DurationHistogram
from fanet_mw.units import MS


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
        """The actor was woken this long after it was due."""
        self._lateness.add(late_ns)
        self.stalled(late_ns)

    def stalled(self, for_ns: int) -> None:
        """The event loop did nothing for this long although it should have."""
        self._stall_ns = max(self._stall_ns, for_ns)

    def summary(self) -> Mapping[str, object]:
        """The figures, by their names in a report."""
        return {
            "wake_lateness_ms": self._lateness.summary(),
            "asked_past_ms": round(self._asked_past_ns / MS, 3),
            "stall_ms": round(self._stall_ns / MS, 3),
        }
