"""Fits the pace of the swarm's clock to what the machine can do, by the reports of one second each.

Late in most moments of a second, or more in 20 s than a limit allows, is an overload: the pace falls to three quarters,
and rises again by CUBIC's curve (RFC 9438, 4.2). The limits are those within which a whole run is valid
(`sim.results.validity`). Where the swarm itself takes all the processor time there is, the pace stays below that of the
overload. In its last second a run is left alone: a process that hears late of another pace would not end with the
others.
"""

import math
from collections import deque
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from emulator.late_requests import moment_ns
from fanet_mw.units import S
from sim.results.validity import HEARD_LATE_LIMIT

_LAST_NS: Final = 1 * S
"""With less real time than this before its end a run keeps its pace."""
_STEP: Final = 0.75
"""What an overload multiplies the pace by."""
_SPREAD: Final = 0.5
"""Lateness in at least this share of a second's moments is an overload."""
_LEAST_MOMENTS: Final = 4
"""Lateness in fewer moments than this may be a single pause, whatever share of the moments they are."""
_MEMORY_NS: Final = 20 * S
"""The real time over which lateness that comes and goes is averaged."""
_BAD_SECONDS: Final = 3
"""Lateness on average counts only if it was beyond the limit in this many seconds: one pause can spoil two."""
_CALM: Final = 0.5
_CLOSE_LIMIT: Final = 0.05
"""The pace rises only if less than this part of a limit is late, and this share of requests come in the last quarter of
their lead."""
_RETURN_NS: Final = 24 * S
"""The real time without lateness after which the pace is the full one."""
_PLATEAU: Final = 0.5
"""The share of the return in which the pace comes back to that of the overload."""
_CATCHES_UP_MS: Final = 25.0
"""A swarm catches up if its requests come so much less late than at the end of the second before."""
_BELOW: Final = 0.9
"""The return pauses at this part of the pace of the overload, which was too fast by up to the last step."""
_WAITS_AT: Final = 0.25
"""The share of the return at which a pace stays as long as the swarm takes all processor time."""
_ALL: Final = 0.85
"""The share of the processors, or of the emulator's one, that is as good as all: the rest is lost between processes."""
_NOTCHES: Final = 20
"""The pace rises in steps of this part of the full one."""


class Counts(NamedTuple):
    """What had been counted until a report of the emulator."""

    frames: int = 0
    late_frames: int = 0
    close_frames: int = 0
    late_moments: int = 0
    late_ms: float = 0.0
    receptions: int = 0
    late_receptions: int = 0
    emulator_cpu_s: float = 0.0
    cpu_s: float = 0.0
    """The processor time of all actors."""

    def since(self, before: "Counts") -> "Counts":
        """What was counted in between; a process that was started again counts from 0."""
        return Counts._make(max(0, now - then) for now, then in zip(self, before, strict=True))

    def excess(self, late_limit: float) -> float:
        """The greater one of both late shares, as a multiple of its limit."""
        frames, receptions = self.late_frames / max(1, self.frames), self.late_receptions / max(1, self.receptions)
        of_frames = frames / late_limit if late_limit else math.inf if frames else 0.0
        return max(of_frames, receptions / HEARD_LATE_LIMIT)


class Instant(NamedTuple):
    """One moment as the launcher sees it."""

    swarm_ns: int
    real_ns: int
    """By a clock that no change of pace moves."""
    cpu_s: float
    """The processor time that the launcher has taken."""


class ClockGovernor:
    """Decides from the actors' reports at which pace the swarm's clock runs."""

    def __init__(self, time_scale: float, *, least: float, late_limit: float, end_ns: int, processors: float) -> None:
        """`least`: the smallest scale; not less than `time_scale`: the clock never slows down. The run ends at the
        swarm instant `end_ns`.
        """
        self.steps: list[tuple[int, float]] = []
        """When the pace changed: swarm instant [ns] and the scale from then on."""
        self.scale = time_scale
        self._full = time_scale
        self._least = least if least < time_scale else math.inf
        self._late_limit = late_limit
        self._end_ns = end_ns
        self._processors = processors
        self._moment_ns = moment_ns(time_scale)
        self._emulator: Mapping[str, Any] = {}
        """The report of the emulator that was looked at last."""
        self._before: tuple[Counts, Instant] | None = None
        self._lately: deque[tuple[int, Counts]] = deque()
        """What was counted in each second that is remembered, with its real instant; forgotten when the pace falls."""
        self._late_ms = self._grown_ms = 0.0
        """The mean lateness in the second before, if that was an overload, and by how much it had grown."""
        self._return = _Return(time_scale, time_scale, time_scale)

    def ask(self, scale: float, *, swarm_ns: int) -> None:
        """Let an operator choose the pace, which is the full one from now on."""
        self.scale = self._full = scale
        self._moment_ns = moment_ns(scale)
        self._lately.clear()
        self._return = _Return(scale, scale, scale)
        self.steps.append((swarm_ns, scale))

    def pace(self, reports: Mapping[str, Mapping[str, Any]], at: Instant) -> float | None:
        """The scale to run at from now on, by the last reports of all actors; None: the clock keeps its pace."""
        emulator = reports.get("emulator", {})
        ends = self._end_ns - at.swarm_ns < _LAST_NS * self.scale
        if ends or self._least >= self._full or emulator is self._emulator:
            return None
        self._emulator = emulator
        counts, before = _counted(reports), self._before or (Counts(), Instant(0, at.real_ns - S, at.cpu_s))
        self._before = (counts, at)
        scale = self._judged(counts.since(before[0]), at, before[1])
        if scale == self.scale:
            return None
        self.scale = scale
        self.steps.append((at.swarm_ns, scale))
        return scale

    def _judged(self, second: Counts, at: Instant, before: Instant) -> float:
        if self._overloaded(second, at, before):
            too_fast = not self._catches_up(second.late_ms / second.late_frames)
        else:
            self._late_ms = self._grown_ms = 0.0
            too_fast = self._often_late(second, at)
        if too_fast:
            self._lately.clear()
            slower = max(self._least, self.scale * _STEP)
            self._return = _Return(slower, max(slower, _BELOW * self.scale), self._full)
            return slower
        calm = second.excess(self._late_limit) < _CALM
        if self.scale < self._full and calm and second.close_frames <= _CLOSE_LIMIT * second.frames:
            return max(self.scale, self._return.after(at.real_ns - before.real_ns, room=self._room(second, at, before)))
        return self.scale

    def _overloaded(self, second: Counts, at: Instant, before: Instant) -> bool:
        """True if requests were late in most moments of a second."""
        moments = max(1, min(second.frames, (at.swarm_ns - before.swarm_ns) // self._moment_ns))
        spread = second.late_moments / moments
        late = second.late_frames > self._late_limit * second.frames
        return late and spread >= _SPREAD and second.late_moments >= _LEAST_MOMENTS

    def _catches_up(self, late_ms: float) -> bool:
        """True if the late requests of this second are less late than the last ones of the second before."""
        last_ms = self._late_ms + max(0.0, self._grown_ms) / 2
        self._late_ms, self._grown_ms = late_ms, late_ms - self._late_ms
        return late_ms < last_ms - _CATCHES_UP_MS * self._full

    def _often_late(self, second: Counts, at: Instant) -> bool:
        """True if more was late lately than a limit allows in that time, and not in one pause alone."""
        self._lately.append((at.real_ns, second))
        while self._lately[0][0] <= at.real_ns - _MEMORY_NS:
            self._lately.popleft()
        seconds = [counts for _, counts in self._lately]
        bad = sum(counts.excess(self._late_limit) > 1 for counts in seconds)
        together = Counts._make(sum(column) for column in zip(*seconds, strict=True))
        known = min(1.0, (at.real_ns - self._lately[0][0] + S) / _MEMORY_NS)
        return bad >= _BAD_SECONDS and together.excess(self._late_limit) * known > 1

    def _room(self, second: Counts, at: Instant, before: Instant) -> bool:
        """True if the swarm, or its emulator, might take more processor time than it does."""
        all_s = _ALL * (at.real_ns - before.real_ns) / S
        taken_s = second.cpu_s + at.cpu_s - before.cpu_s
        return second.emulator_cpu_s < all_s and taken_s < self._processors * all_s


class _Return:
    """The way back from `slower` to the full pace, with a plateau in between."""

    def __init__(self, slower: float, plateau: float, full: float) -> None:
        self._slower, self._plateau, self._full = slower, plateau, full
        self._done = 0.0
        """The share of the way that lies behind, in time."""

    def after(self, real_ns: int, *, room: bool) -> float:
        """The scale when that much more real time has passed without lateness."""
        done = self._done + real_ns / _RETURN_NS
        self._done = min(1.0, done) if room else min(done, max(self._done, _WAITS_AT))
        from_plateau = self._done / _PLATEAU - 1  # from -1 to 1
        span = self._plateau - self._slower if from_plateau < 0 else self._full - self._plateau
        scale = self._plateau + span * math.pow(from_plateau, 3)
        notch = math.floor(scale / self._full * _NOTCHES + 1e-9)
        return max(self._slower, self._full * notch / _NOTCHES)


def _counted(reports: Mapping[str, Mapping[str, Any]]) -> Counts:
    emulator = reports.get("emulator", {})
    late = emulator.get("late", {})
    agents = [report for report in reports.values() if report.get("kind") == "agent"]
    return Counts(
        frames=late.get("frames", 0),
        late_frames=late.get("late_frames", 0),
        close_frames=late.get("close_frames", 0),
        late_moments=late.get("late_moments", 0),
        late_ms=late.get("sum_ms", 0.0),
        receptions=sum(report.get("receptions", 0) for report in agents),
        late_receptions=sum(report.get("heard_late", 0) for report in agents),
        emulator_cpu_s=_cpu_s(emulator),
        cpu_s=sum(map(_cpu_s, reports.values())),
    )


def _cpu_s(report: Mapping[str, Any]) -> float:
    used: float = (report.get("host") or {}).get("cpu_s", 0.0)
    return used
