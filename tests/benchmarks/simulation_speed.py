"""How fast whole swarms simulate, routing in Python included: `python tests/benchmarks/simulation_speed.py [--short]`.

Plain flooding by 44 sources on the 9 x 5 grid, and by one source in swarms of 45 to 1,000 nodes. It prints the CPU time
of the run, which is wall time when nothing else runs, and that of the run with its results, as `fanet simulate` has
them. Both depend on the machine, the growth with the number of nodes does not. `beside_ns3.py` compares with ns-3, in
turns on one machine.
"""

import argparse
import math
import sys
from time import process_time
from typing import Any, Final

from fanet_mw.scenario import Scenario, config
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

INTERVALS_S: Final = (1.0, 0.1)
_SIZES: Final = (45, 100, 200, 400, 1000)
_ASKED_EXPONENT: Final = 1.2


def timed(scenario: Scenario) -> dict[str, Any]:
    """The summary of a run, and the CPU time that it took, without and with this summary [s]."""
    began_s = process_time()
    outcome = simulate(scenario)
    run_s = process_time() - began_s
    summary = finish(outcome, out=None)
    return {**summary, "cpu_s": run_s, "whole_s": process_time() - began_s}


def grid(interval_s: float, seconds: float) -> dict[str, Any]:
    settings = [f"traffic.interval_s={interval_s}", "traffic.sources=44", f"duration_s={seconds}"]
    return timed(catalog.find("flooding", settings))


def settings_of_one_source(count: int) -> dict[str, Any]:
    """1 packet per second from one node, 20 s, at the density of the grid."""
    return {
        "duration_s": 20,
        "nodes": {"count": count, "telemetry_hz": 0},
        "routing": {"protocol": "flooding", "hello_interval_s": 0, "hop_limit": 128},
        "clusters": {"count": 1},
        "traffic": {"sources": 1, "interval_s": 1.0},
        "radio": {"access": "ns3", "lead_ms": 0},
    }


def one_source(count: int) -> dict[str, Any]:
    scenario = config.build(settings_of_one_source(count))
    runs = [timed(scenario) for _ in range(3)]  # one of them may collect the garbage of earlier runs
    return min(runs, key=lambda run: run["cpu_s"])


def main() -> int:
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--short", action="store_true", help="20 s of the grid instead of 100 s")
    seconds = 20.0 if flags.parse_args().short else 100.0
    simulate(catalog.find("flooding", ["duration_s=2"]))  # the kernel is loaded
    print(f"9 x 5 grid, flooding by 44 sources, {seconds:g} s simulated")
    print("interval s   CPU s  with results  frames   us/frame  PDR")
    for interval_s in INTERVALS_S:
        found = grid(interval_s, seconds)
        cpu_s, frames = found["cpu_s"], found["frames"]["sent"]
        print(
            f"{interval_s:10}  {cpu_s:6.2f}  {found['whole_s']:12.2f}  {frames:7}  {1e6 * cpu_s / frames:8.2f}  "
            f"{found['pdr']:.4f}"
        )
    print("\n1 source, 1 packet/s, 20 s simulated, equal density")
    print("nodes   CPU s  frames  us/frame  exponent of us/frame over nodes, from the smallest")
    first: tuple[int, float] | None = None
    worst = 0.0
    for count in _SIZES:
        found = one_source(count)
        per_frame_us = 1e6 * found["cpu_s"] / found["frames"]["sent"]
        first = first or (count, per_frame_us)
        exponent = math.log(per_frame_us / first[1]) / math.log(count / first[0]) if count > first[0] else 0.0
        worst = max(worst, exponent)
        print(f"{count:5}  {found['cpu_s']:6.3f}  {found['frames']['sent']:6}  {per_frame_us:8.2f}  {exponent:5.2f}")
    print(f"grows as nodes^{worst:.2f} at most per frame; asked: nodes^{_ASKED_EXPONENT}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
