"""Speed beside earlier code: `python tests/benchmarks/beside_commit.py REVISION [--turns N] [--seconds S ...]`.

The code of this work tree and that of a commit of this repository make the runs of `simulation_speed` (plain flooding
on the grid, and by one source in swarms of several sizes) in turns on one processor. Every run has a new process,
because where a process has its memory changes its speed by a percent or two. For each case it prints the CPU time of
this code divided by that of the commit: the median over the turns, and the standard error of their mean. The commit
needs a `tests/benchmarks/simulation_speed.py`. The default takes 8 minutes.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import median, stdev
from typing import Any, Final, NamedTuple

from simulation_speed import INTERVALS_S, settings_of_one_source

_ROOT: Final = Path(__file__).parents[2]
_RUN: Final = """
import json
import sys
from time import process_time
import simulation_speed as speed

case = json.loads(sys.argv[1])
speed.grid(1.0, 2.0)  # the kernel is loaded
began_s = process_time()
found = speed.grid(*case) if isinstance(case, list) else speed.timed(speed.config.build(case))
print(found["cpu_s"], process_time() - began_s, found["frames"]["sent"])
"""
"""Runs one case with the `simulation_speed` of either tree: on the grid, or a scenario by its settings. Swarms of one
source come as settings, because `one_source` of this tree times each of them three times."""
Case = list[float] | dict[str, Any]
"""The interval between packets and the length of a run on the grid [s], or the settings of a scenario."""


class Timed(NamedTuple):
    cpu_s: float
    """The CPU time of the run."""
    whole_s: float
    """The CPU time of the run with its summary."""
    frames: int


def run(tree: Path, case: Case) -> Timed:
    """Run a case with the code of a tree."""
    path = os.pathsep.join((str(tree), str(tree / "tests" / "benchmarks")))
    found = subprocess.run(
        [sys.executable, "-c", _RUN, json.dumps(case)],
        cwd=tree, env={**os.environ, "PYTHONPATH": path}, check=True, capture_output=True, text=True,
    )  # fmt: skip
    cpu_s, whole_s, frames = found.stdout.split()
    return Timed(float(cpu_s), float(whole_s), int(frames))


@contextmanager
def _tree_of(revision: str) -> Iterator[Path]:
    """A temporary folder with the files of a commit."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        subprocess.run(["git", "worktree", "add", "--detach", "--quiet", tree, revision], cwd=_ROOT, check=True)
        try:
            yield tree
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=_ROOT, check=True)


def in_turns(case: Case, theirs: Path, *, turns: int) -> list[tuple[Timed, Timed]]:
    """The times of a case with this code and with theirs; each of the two begins every other turn."""
    found = []
    for turn in range(turns):
        trees = (theirs, _ROOT) if turn % 2 else (_ROOT, theirs)
        timed = {tree: run(tree, case) for tree in trees}
        found.append((timed[_ROOT], timed[theirs]))
    return found


def _shown(ratios: Sequence[float]) -> str:
    error = stdev(ratios) / math.sqrt(len(ratios)) if len(ratios) > 1 else math.nan
    return f"{median(ratios):5.3f} +- {error:5.3f}"


def main() -> int:
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("revision", help="the commit to compare with")
    flags.add_argument("--turns", type=int, default=9, help="the number of runs of each case by each code")
    flags.add_argument("--seconds", type=float, nargs="*", default=[20.0, 100.0], help="how long runs on the grid are")
    flags.add_argument("--sizes", type=int, nargs="*", default=[45, 200, 1000], help="the swarms with one source")
    chosen = flags.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    cases: dict[str, Case] = {
        f"grid {interval_s} {seconds}": [interval_s, seconds]
        for seconds in chosen.seconds
        for interval_s in INTERVALS_S
    }
    cases |= {f"one_source {size}": settings_of_one_source(size) for size in chosen.sizes}
    print(f"CPU time relative to {chosen.revision}, {chosen.turns} turns")
    print("case (interval s, seconds; nodes)   CPU of the run   with its summary   frames")
    with _tree_of(chosen.revision) as tree:
        for name, case in cases.items():
            pairs = in_turns(case, tree, turns=chosen.turns)
            same = "the same" if all(a.frames == b.frames for a, b in pairs) else "differ"
            cpu, whole = [a.cpu_s / b.cpu_s for a, b in pairs], [a.whole_s / b.whole_s for a, b in pairs]
            print(f"{name:34}  {_shown(cpu)}   {_shown(whole)}     {same}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
