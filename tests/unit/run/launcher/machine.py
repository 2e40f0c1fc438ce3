"""A model of a machine on which a swarm of processes runs, with as much as the launcher sees of it: late requests."""

from collections.abc import Callable
from typing import Any

from emulator.late_requests import moment_ns
from fanet_mw.units import S
from sim.run.launcher.clock_governor import ClockGovernor, Instant

PER_S = 1000
"""The requests of one swarm second."""
LEAD_S = 0.1
STEP_S = 0.005
Taken = Callable[[float, float], float]


def alone(capacity: float, scale: float) -> float:
    """Nothing but the swarm runs on the machine: what it takes grows to all there is."""
    return min(1.0, scale / capacity) if capacity else 0.0


def beside_others(capacity: float, scale: float) -> float:
    """Others share the machine, and what the swarm takes never shows where the end is."""
    return 0.5 * alone(capacity, scale)


class Machine:
    """`capacity(t)`: the swarm seconds that it gets done in one real second; 0 while it is paused.

    `taken(capacity, scale)`: the share of processor time that the swarm takes.
    """

    def __init__(
        self, capacity: Callable[[float], float], taken: Taken, *, least: float = 0.05, end_s: float = 10_000
    ) -> None:
        self.scale = 1.0
        self.history: list[tuple[float, float]] = [(0.0, 1.0)]
        self.late = self.frames = 0.0
        self.governor = ClockGovernor(1.0, least=least, late_limit=0.01, end_ns=round(end_s * S), processors=1.0)
        self._capacity, self._taken = capacity, taken
        self._t = self._swarm_s = self._queued_s = self._taken_s = self._late_ms = self._close = 0.0
        self._moments: set[int] = set()

    def run(self, until_s: float) -> None:
        while self._t < until_s:
            for _ in range(round(1 / STEP_S)):
                self._pass(STEP_S)
            self._report()

    def slowest(self) -> float:
        return min(scale for _, scale in self.history)

    def _pass(self, real_s: float) -> None:
        capacity = self._capacity(self._t)
        self._t += real_s
        self._swarm_s += self.scale * real_s
        self._queued_s += self.scale * real_s
        done_s = min(self._queued_s, capacity * real_s)
        waited_s = self._queued_s - done_s  # how far what is done now lies behind the swarm's clock
        self._queued_s -= done_s
        frames = PER_S * done_s
        self.frames += frames
        if waited_s > LEAD_S:
            self.late += frames
            self._late_ms += frames * (waited_s - LEAD_S) * 1e3
            self._moments.add(round(self._swarm_s * S) // moment_ns(1.0))
        elif waited_s > 0.75 * LEAD_S:
            self._close += frames
        self._taken_s += self._taken(capacity, self.scale) * real_s

    def _report(self) -> None:
        late = {
            "frames": int(self.frames), "late_frames": int(self.late), "close_frames": int(self._close),
            "late_moments": len(self._moments), "sum_ms": self._late_ms,
        }  # fmt: skip
        reports: dict[str, dict[str, Any]] = {"emulator": {"kind": "emulator", "late": late}}
        at = Instant(round(self._swarm_s * S), round(self._t * S), self._taken_s)
        for _ in range(4):  # the launcher looks more often than actors report
            scale = self.governor.pace(reports, at)
            if scale is not None:
                self.scale = scale
                self.history.append((self._t, scale))
