"""The pauses of a machine, in which nothing runs for a while: those of a hypervisor, and those of a busy scheduler.

A pause delays whatever was due in it, so it is seen by whoever wakes up late. The lead of a swarm should be longer than
the pauses of its machine.
"""

import asyncio
import contextlib
import os
import threading
import time
from pathlib import Path
from typing import Any, Final

from fanet_mw.units import MS, S

LEAST_NS: Final = 50 * MS
"""A shorter delay is not counted as a pause: the scheduler of a busy machine makes many of them."""
_TICK_NS: Final = 20 * MS
_QUOTA: Final = Path("/sys/fs/cgroup/cpu.max")


class PauseWatch:
    """Counts the pauses of this process while it runs, on its event loop."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._timer = self._loop.call_later(0, lambda: None)
        self.restart()

    def restart(self) -> None:
        self.count = 0
        self.longest_ns = 0
        """The longest delay, also if it was too short for a pause."""
        self.total_ns = 0
        self._wait()

    def _wait(self) -> None:
        self._timer.cancel()
        self._due_ns = time.monotonic_ns() + _TICK_NS
        self._timer = self._loop.call_later(_TICK_NS / S, self._tick)

    def _tick(self) -> None:
        late_ns = time.monotonic_ns() - self._due_ns
        self.longest_ns = max(self.longest_ns, late_ns)
        if late_ns >= LEAST_NS:
            self.count += 1
            self.total_ns += late_ns
        self._wait()

    def close(self) -> None:
        self._timer.cancel()

    def summary(self) -> dict[str, Any]:
        return {
            "count": self.count,
            "longest_ms": round(self.longest_ns / MS, 1),
            "total_ms": round(self.total_ns / MS, 1),
        }


def longest_pause_ns(for_s: float) -> int:
    """The longest pause of any processor that this process may use, measured for some time by waking up on all."""
    found: list[int] = []
    threads = [
        threading.Thread(target=_measure, args=(processor, for_s, found)) for processor in os.sched_getaffinity(0)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return max(found)


def _measure(processor: int, for_s: float, found: list[int]) -> None:
    """Sleep for a millisecond at a time on one processor, and note the longest delay."""
    with contextlib.suppress(OSError):
        os.sched_setaffinity(0, {processor})  # of this thread alone
    began_ns = last_ns = time.monotonic_ns()
    longest_ns = 0
    while last_ns < began_ns + for_s * S:
        time.sleep(0.001)
        now_ns = time.monotonic_ns()
        longest_ns, last_ns = max(longest_ns, now_ns - last_ns - MS), now_ns
    found.append(longest_ns)


def processors() -> float:
    """The number of processors that this process may use, which a container's quota can make a fraction."""
    count = float(len(os.sched_getaffinity(0)))
    with contextlib.suppress(OSError, ValueError):
        quota, period = _QUOTA.read_text(encoding="ascii").split()
        count = min(count, int(quota) / int(period))  # without a quota its word is "max", which is no number
    return count
