"""The same swarm in ns-3 and in ours, in turns on this machine: `python tests/benchmarks/beside_ns3.py PREFIX`.

PREFIX: an installed ns-3.44, see `tests/ns3/live.py`. Both sides are timed in CPU seconds of the simulation alone,
without start-up; the least of the runs counts, because other work on the machine only ever adds. Judges nothing: the
ratio depends a little on the machine, and on how its Python was built (docs/reference/results.md).
"""

import argparse
import sys
import tempfile
from pathlib import Path
from time import process_time
from typing import Final, NamedTuple

from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog
from tests.ns3 import live

_INTERVALS_S: Final = (1.0, 0.1)


class Run(NamedTuple):
    """One simulation of either side."""

    cpu_s: float
    frames: int
    pdr: float


def theirs(program: Path, interval_s: float, seconds: float, run: int) -> Run:
    said = live.run(program, interval=interval_s, duration=seconds, run=run)
    return Run(said["cpu_s"], int(said["sent"]), said["pdr"])


def ours(interval_s: float, seconds: float, run: int) -> Run:
    settings = [f"traffic.interval_s={interval_s}", "traffic.sources=44", f"duration_s={seconds}", f"seed={run}"]
    scenario = catalog.find("flooding", settings)
    began_s = process_time()
    outcome = simulate(scenario)
    cpu_s = process_time() - began_s
    found = finish(outcome, out=None)
    return Run(cpu_s, found["frames"]["sent"], found["pdr"])


def main() -> int:
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("prefix", type=Path, help="folder with include/ and lib64/ of ns-3.44")
    flags.add_argument("--seconds", type=float, default=100.0, help="simulated")
    flags.add_argument("--runs", type=int, default=3, help="of each side, in turns")
    asked = flags.parse_args()
    simulate(catalog.find("flooding", ["duration_s=2"]))  # the kernel is loaded
    with tempfile.TemporaryDirectory() as folder:
        program = live.build(asked.prefix, Path(folder))
        print(f"9 x 5 grid, flooding by 44 sources, {asked.seconds:g} s simulated, the least of {asked.runs} runs each")
        print("interval s   ns-3 CPU s  frames  PDR       ours CPU s  frames  PDR       times faster")
        for interval_s in _INTERVALS_S:
            pairs = [
                (theirs(program, interval_s, asked.seconds, run), ours(interval_s, asked.seconds, run))
                for run in range(1, asked.runs + 1)
            ]
            slow, fast = min(pair[0] for pair in pairs), min(pair[1] for pair in pairs)
            print(
                f"{interval_s:10}   {slow.cpu_s:10.2f}  {slow.frames:6}  {slow.pdr:.4f}    "
                f"{fast.cpu_s:10.2f}  {fast.frames:6}  {fast.pdr:.4f}    {slow.cpu_s / fast.cpu_s:6.1f}"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
