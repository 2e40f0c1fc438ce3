"""The time that a run will take: a rough guess from what its scenario puts on the air.

The time is that of the copies of frames at receivers, mostly. The guess is good to a factor of two or so; as runs of a
sweep end, what is left is told from how much the guesses were off.
"""

import math
from collections.abc import Iterable
from typing import Final

from agents.applications.traffic import sources_of
from fanet_mw.scenario.model import Scenario

_START_S: Final = 0.3
"""Setting up and summing up."""
_START_UP_S: Final = 3.0
"""In real time: until the processes begin to start, and from their end to the summary."""
_PER_PROCESS_S: Final = 0.1
"""In real time: start and end of one process."""
_PER_NODE_S: Final = 1.5e-3
"""CPU seconds per node and simulated second: hellos, fixes, timers."""
_PER_BODY_S: Final = 3e-3
"""The same for a body of the physics engine."""
_PER_FRAME_S: Final = 40e-6
"""CPU seconds per frame on the air, with its copies at some eight receivers."""
_PER_TURN_S: Final = 250e-6
"""CPU seconds per packet and node in a timetable: turns, room and bounds are computed for each."""
_MOST_FRAMES: Final = 80
"""Frames per node and second when the channel is full: 11 Mb/s, shared by some nine in reach."""


def guess_s(scenario: Scenario) -> float:
    """CPU seconds that one run will take on a present core."""
    count, traffic = scenario.nodes.count, scenario.traffic
    saturated = traffic.arrivals == "saturated"
    packets = math.inf if saturated else len(sources_of(scenario)) / traffic.interval_s
    relays = count if traffic.destination == "all" and scenario.routing.protocol != "direct" else 5
    frames = min(packets * relays, _MOST_FRAMES * count)
    start_ns, end_ns = scenario.traffic_window_ns
    work_s = frames * _PER_FRAME_S
    if scenario.routing.protocol == "clustered" and scenario.clusters.relay == "scheduled":
        work_s += min(packets, _MOST_FRAMES * 10) * count * _PER_TURN_S
    bodies = _PER_BODY_S * count if scenario.world.engine == "pybullet" else 0.0
    idle = _START_S + scenario.duration_s * (_PER_NODE_S * count + bodies)
    return idle + (end_ns - start_ns) / 1e9 * work_s


def launch_s(scenario: Scenario) -> float:
    """Seconds that one run in real time will take: its own, and those in which its processes start."""
    return scenario.duration_s / scenario.time_scale + _START_UP_S + _PER_PROCESS_S * scenario.nodes.count


class TimeLeft:
    """What is left of a sweep, by guesses that are corrected by what the finished runs took."""

    def __init__(self, guesses_s: Iterable[float], *, workers: int) -> None:
        self._left_s = math.fsum(guesses_s)
        self._workers = workers
        self._guessed_s = self._took_s = 0.0

    def done(self, guess: float, took: float) -> None:
        """A run has ended that was guessed to take so long."""
        self._left_s -= guess
        self._guessed_s += guess
        self._took_s += took

    def seconds(self) -> float:
        """Wall seconds until the last run ends, about."""
        off = self._took_s / self._guessed_s if self._guessed_s else 1.0
        return max(0.0, self._left_s * off / self._workers)


def spoken(seconds: float) -> str:
    """A length of time as people say it."""
    if seconds < 90:
        return f"{math.ceil(seconds)} s"
    if seconds < 5400:
        return f"{round(seconds / 60)} min"
    return f"{seconds / 3600:.1f} h"
