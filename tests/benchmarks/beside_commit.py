"""Speed beside earlier code: `python tests/benchmarks/beside_commit.py REVISION [--pairs N] [--seconds S ...]`.

The runs of `simulation_speed` (plain flooding on the grid, and by one source in swarms of several sizes) by the code of
this work tree and by that of a commit of this repository. A process of each runs every case in turns with the other on
one processor; then a new pair of processes begins, because where a process has its memory changes its speed by a
percent or two. It prints, for each case, the CPU time of this code divided by that of the commit: the mean over the
pairs of their median ratios, and its standard error. The commit needs a `tests/benchmarks/simulation_speed.py`. With
the default five pairs it takes ten minutes.
"""

import argparse
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import mean, median, stdev
from typing import Final, NamedTuple, Self

_ROOT: Final = Path(__file__).parents[2]
_WORKER: Final = """
import sys
from time import process_time
import simulation_speed as speed
speed.grid(1.0, 2.0)  # the kernel is loaded
def one_source(count):
    return speed.timed(speed.config.build({
        "duration_s": 20,
        "nodes": {"count": count, "telemetry_hz": 0},
        "routing": {"protocol": "flooding", "hello_interval_s": 0, "hop_limit": 128},
        "clusters": {"count": 1},
        "traffic": {"sources": 1, "interval_s": 1.0},
        "radio": {"access": "ns3", "lead_ms": 0},
    }))
for line in sys.stdin:
    case, *values = line.split()
    began_s = process_time()
    found = speed.grid(*map(float, values)) if case == "grid" else one_source(int(values[0]))
    print(found["cpu_s"], process_time() - began_s, found["frames"]["sent"], flush=True)
"""
"""Runs cases with the `simulation_speed` of either tree. It makes the swarms of one source itself, because that of this
tree times each of them three times."""
_TURNS: Final = 3
"""The number of runs of a case by each process of a pair."""


class Timed(NamedTuple):
    cpu_s: float
    """The CPU time of the run."""
    whole_s: float
    """That of the run with its summary."""
    frames: int


class Worker:
    """A process that runs cases with the code of one tree."""

    def __init__(self, tree: Path) -> None:
        path = os.pathsep.join((str(tree), str(tree / "tests" / "benchmarks")))
        self._process = subprocess.Popen(
            [sys.executable, "-c", _WORKER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=tree,
            env={**os.environ, "PYTHONPATH": path}, preexec_fn=_on_one_processor,
        )  # fmt: skip

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()

    def run(self, case: str) -> Timed:
        """Run a case: `grid INTERVAL_S SECONDS` or `one_source NODES`."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(case + "\n")
        self._process.stdin.flush()
        cpu_s, whole_s, frames = self._process.stdout.readline().split()
        return Timed(float(cpu_s), float(whole_s), int(frames))


class Ratios(NamedTuple):
    """What this code takes, divided by what the commit takes, in one pair of processes."""

    cpu: float
    whole: float
    same_frames: bool

    @classmethod
    def of(cls, ours: Sequence[Timed], theirs: Sequence[Timed]) -> Self:
        pairs = list(zip(ours, theirs, strict=True))
        return cls(
            median(a.cpu_s / b.cpu_s for a, b in pairs),
            median(a.whole_s / b.whole_s for a, b in pairs),
            all(a.frames == b.frames for a, b in pairs),
        )


def _on_one_processor() -> None:
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


@contextmanager
def _tree_of(revision: str) -> Iterator[Path]:
    """The files of a commit, in a folder for a while."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        subprocess.run(["git", "worktree", "add", "--detach", "--quiet", tree, revision], cwd=_ROOT, check=True)
        try:
            yield tree
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=_ROOT, check=True)


def _in_turns(cases: Sequence[str], theirs: Path, *, odd: bool) -> Iterator[Ratios]:
    """The ratios of each case in one new pair of processes; `odd`: the commit begins."""
    with ExitStack() as stack:
        ours, others = (stack.enter_context(Worker(tree)) for tree in (_ROOT, theirs))
        for case in cases:
            found: dict[Worker, list[Timed]] = {ours: [], others: []}
            for turn in range(_TURNS):
                for worker in (ours, others) if (turn % 2 == 0) != odd else (others, ours):
                    found[worker].append(worker.run(case))
            yield Ratios.of(found[ours], found[others])


def _shown(values: Sequence[float]) -> str:
    error = stdev(values) / math.sqrt(len(values)) if len(values) > 1 else math.nan
    return f"{mean(values):6.3f} +- {error:5.3f}"


def main() -> int:
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("revision", help="the commit to compare with")
    flags.add_argument("--pairs", type=int, default=5, help="the number of pairs of processes")
    flags.add_argument("--seconds", type=float, nargs="*", default=[20.0, 100.0], help="how long runs on the grid are")
    flags.add_argument("--sizes", type=int, nargs="*", default=[45, 200, 1000], help="the swarms with one source")
    chosen = flags.parse_args()
    cases = [f"grid {interval_s} {seconds}" for seconds in chosen.seconds for interval_s in (1.0, 0.1)]
    cases += [f"one_source {size}" for size in chosen.sizes]
    with _tree_of(chosen.revision) as tree:
        pairs = [list(_in_turns(cases, tree, odd=bool(pair % 2))) for pair in range(chosen.pairs)]
    print(f"CPU time relative to {chosen.revision}, {chosen.pairs} pairs of processes")
    print("case (interval s, seconds; nodes)   CPU of the run   with its summary   frames")
    for case, ratios in zip(cases, zip(*pairs, strict=True), strict=True):
        same = "the same" if all(ratio.same_frames for ratio in ratios) else "differ"
        print(f"{case:34}  {_shown([r.cpu for r in ratios])}  {_shown([r.whole for r in ratios])}    {same}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
