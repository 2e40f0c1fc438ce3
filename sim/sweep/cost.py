"""Estimates how long a run will take, from the frames that its scenario will put on the air.

Most of the time goes into the copies of frames at receivers. The estimate of the processor time is right to a factor of
about two. Workers share the cores with whatever else the machine does. While runs of a sweep end, the estimate for the
rest is corrected by how much the finished ones took.
"""

import math
import os
import time
from typing import Final

from agents.applications.traffic import sources_of
from fanet_mw.scenario.model import Scenario

_START_S: Final = 0.05
"""The time to set up and to summarize a run."""
_START_UP_S: Final = 3.0
"""In real time: the time until the processes begin to start, and from their end to the summary."""
_PER_PROCESS_S: Final = 0.1
"""In real time: the time to start and end one process."""
_PER_HELLO_S: Final = 0.25e-3
"""CPU seconds per hello, including what neighbors do about it."""
_PER_FLIGHT_S: Final = 0.6e-3
"""CPU seconds per simulated second for each flying node: guidance, fixes, links."""
_PER_SEARCHER_S: Final = 3.3e-3
"""The same for each node of a planned search."""
_PER_BODY_S: Final = 3e-3
"""The same for each body of the physics engine."""
_PER_FRAME_S: Final = 30e-6
"""CPU seconds per frame on the air, with its copies at some eight receivers."""
_PER_HEADS_FRAME_S: Final = 60e-6
"""The same if heads queue packets for their slots."""
_PER_TURN_S: Final = 85e-6
"""CPU seconds per packet and node with a timetable, whose turns, room and bounds are computed for each."""
_WORKER_S: Final = 3.0
"""CPU seconds until a worker process of this machine begins its first run."""
_SPIN_S: Final = 0.25
"""The time for which it is tried how much of a core there is."""
_TRUSTED_S: Final = 10.0
"""Finished runs count for the rest as much as the estimate once so many seconds of them were expected."""
_MOST_FRAMES: Final = 80
"""The number of frames per node and second on a saturated channel: 11 Mb/s, shared by about nine nodes within reach."""


def guess_s(scenario: Scenario) -> float:
    """The CPU seconds that one run will take on a present core."""
    count, clustered = scenario.node_count, scenario.routing.protocol == "clustered"
    by_timetable = clustered and scenario.clusters.relay == "scheduled"
    classes = scenario.traffic_classes
    packets = math.fsum(_packets(scenario, name) for name in classes)
    to_all = any(traffic.destination == "all" for traffic in classes.values())
    everyone = to_all and scenario.routing.protocol != "direct"
    frames = min(packets * (count if everyone else 5), _MOST_FRAMES * count)
    start_ns, end_ns = scenario.traffic_window_ns
    work_s = frames * (_PER_HEADS_FRAME_S if clustered and not by_timetable else _PER_FRAME_S)
    if by_timetable:
        work_s += min(packets, _MOST_FRAMES * 10) * count * _PER_TURN_S
    hello_s = scenario.routing.hello_interval_s
    per_node = _PER_HELLO_S / hello_s if hello_s else 0.0
    per_node += _PER_FLIGHT_S if scenario.mobility.model != "static" else 0.0
    per_node += _PER_SEARCHER_S if scenario.mission.search != "none" else 0.0
    per_node += _PER_BODY_S if scenario.world.engine == "pybullet" else 0.0
    idle = _START_S + scenario.duration_s * per_node * count
    return idle + (end_ns - start_ns) / 1e9 * work_s


def _packets(scenario: Scenario, name: str) -> float:
    """The number of packets of a class per second."""
    traffic = scenario.traffic_classes[name]
    if traffic.arrivals == "saturated":
        return math.inf
    return len(sources_of(scenario, name)) / traffic.interval_s


def launch_s(scenario: Scenario) -> float:
    """The seconds that one run in real time will take, including those in which its processes start."""
    return scenario.duration_s / scenario.time_scale + _START_UP_S + _PER_PROCESS_S * scenario.node_count


def pace_of_workers(workers: int) -> float:
    """The share of a core that each of some new processes gets, beside what else the machine does.

    Others are those that ran in the last minute, but no more than the share that this process gets allows for.
    """
    cores = len(os.sched_getaffinity(0))
    others = min(os.getloadavg()[0], cores / share_of_core() - 1)
    return min(1.0, cores / (workers + others))


def share_of_core() -> float:
    """The share of a core that this process gets now."""
    began_s, cpu_s = time.perf_counter(), time.thread_time()
    while (wall_s := time.perf_counter() - began_s) < _SPIN_S:
        pass
    return max(0.01, min(1.0, (time.thread_time() - cpu_s) / wall_s))


class TimeLeft:
    """The remaining time of a sweep, estimated and corrected by what the finished runs took."""

    def __init__(self, virtual_s: float, realtime_s: float, *, workers: int, pace: float) -> None:
        """`virtual_s`, `realtime_s`: the sums of the estimates; runs in real time come one after the other.
        `pace`: the share of a core that a worker gets.
        """
        self._virtual_s, self._realtime_s = virtual_s, realtime_s
        self._workers = workers
        self._guessed_s, self._took_s = _TRUSTED_S, _TRUSTED_S / pace
        self._start_s = _WORKER_S / pace if virtual_s else 0.0

    def done(self, guess: float, took: float, *, realtime: bool) -> None:
        """A run has ended, for which `guess` was estimated and which took so many wall seconds."""
        if realtime:
            self._realtime_s -= guess
            return
        self._virtual_s -= guess
        self._guessed_s += guess
        self._took_s += took
        self._start_s = 0.0

    def seconds(self) -> float:
        """The estimated wall seconds until the last run ends."""
        virtual_s = max(0.0, self._virtual_s) * self._took_s / self._guessed_s / self._workers
        return self._start_s + virtual_s + max(0.0, self._realtime_s)


def spoken(seconds: float) -> str:
    """A duration in words."""
    if seconds < 90:
        return f"{math.ceil(seconds)} s"
    if seconds < 5400:
        return f"{round(seconds / 60)} min"
    return f"{seconds / 3600:.1f} h"
