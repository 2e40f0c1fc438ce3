"""What the process of a real-time host has cost since its start: CPU time, memory, puts on the bus."""

import resource
from collections.abc import Mapping
from pathlib import Path


class ProcessCost:
    """The cost of one process."""

    def __init__(self) -> None:
        self.puts = 0
        """The number of puts on the bus."""

    def summary(self, *, final: bool) -> Mapping[str, object]:
        """The figures, by their names in a report."""
        usage = resource.getrusage(resource.RUSAGE_SELF)
        return {
            "cpu_s": round(usage.ru_utime + usage.ru_stime, 3),
            "uss_mb": uss_mb() if final else None,  # reading it delays the process by more than a millisecond
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
