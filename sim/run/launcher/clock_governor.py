"""Slows the swarm's clock down while the machine cannot keep up with it.

    reports of one second -> share of late transmit requests and of late receptions in it -> beyond a limit?
    far beyond, or beyond in two seconds one after the other -> the clock passes more slowly from now on

The limits are those within which a whole run is valid (`sim.results.validity`), so that a run that holds real time is
left alone, and one that does not loses a few seconds of its first half minute instead of its validity. The clock
never becomes faster again: a load that has come once may come again. In its last second of real time a run is left
alone: a process that hears late of a slower clock would end before the others do.
"""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from fanet_mw.units import S
from sim.results.validity import HEARD_LATE_LIMIT

FAR_BEYOND: Final = 10.0
"""A share of this many times its limit is taken for an overload at once."""
_LAST_NS: Final = 1 * S
"""With less real time than this before its end a run is not slowed down."""
_STEP: Final = 0.75
_GREAT_STEP: Final = 0.5
"""What the clock's scale is multiplied by; the greater step is for an overload that is far beyond a limit."""


class _Counts(NamedTuple):
    """What had been counted until a report of the emulator."""

    frames: int
    late_frames: int
    receptions: int
    late_receptions: int

    def since(self, before: "_Counts") -> "_Counts":
        return _Counts(*(now - then for now, then in zip(self, before, strict=True)))

    def excess(self, late_limit: float) -> float:
        """The greater one of both late shares, as a multiple of its limit."""
        return max(
            self.late_frames / max(1, self.frames) / late_limit,
            self.late_receptions / max(1, self.receptions) / HEARD_LATE_LIMIT,
        )


class ClockGovernor:
    """Decides from the actors' reports when the clock slows down, and to what scale."""

    def __init__(self, time_scale: float, *, least: float, late_limit: float, end_ns: int) -> None:
        """`least` is the smallest scale to which the clock may slow down; not less than `time_scale`: it never does.
        The run ends at the swarm instant `end_ns`.
        """
        self.steps: list[tuple[int, float]] = []
        """When the clock slowed down: swarm instant [ns] and the scale from then on."""
        self._scale = time_scale
        self._least = least
        self._late_limit = late_limit
        self._end_ns = end_ns
        self._emulator: Mapping[str, Any] = {}
        """The report of the emulator that was looked at last."""
        self._before: _Counts | None = _Counts(0, 0, 0, 0)
        self._beyond = False
        """True if the second before was beyond a limit, too."""

    def slower(self, reports: Mapping[str, Mapping[str, Any]], now_ns: int) -> float | None:
        """The scale to slow down to now, by the last reports of all actors; None: the clock stays as it is."""
        emulator = reports.get("emulator", {})
        ends = self._end_ns - now_ns < _LAST_NS * self._scale
        if ends or self._scale <= self._least or emulator is self._emulator:
            return None
        self._emulator = emulator
        counts, before = _counted(reports), self._before
        self._before = counts
        if before is None:
            return None
        excess = counts.since(before).excess(self._late_limit)
        beyond_before, self._beyond = self._beyond, excess > 1
        if excess <= FAR_BEYOND and not (self._beyond and beyond_before):
            return None
        step = _GREAT_STEP if excess > FAR_BEYOND else _STEP
        self._scale = max(self._least, self._scale * step)
        self._before, self._beyond = None, False  # the next second still empties what has been waiting
        self.steps.append((now_ns, self._scale))
        return self._scale


def _counted(reports: Mapping[str, Mapping[str, Any]]) -> _Counts:
    late = reports.get("emulator", {}).get("late", {})
    agents = [report for report in reports.values() if report.get("kind") == "agent"]
    return _Counts(
        frames=late.get("frames", 0),
        late_frames=late.get("late_frames", 0),
        receptions=sum(report.get("receptions", 0) for report in agents),
        late_receptions=sum(report.get("heard_late", 0) for report in agents),
    )
