"""How fast 45 UAVs fly in virtual time, by engine: `python tests/benchmarks/flight_speed.py [--seconds 30] [--whole]`.

The first table is of the world alone, with all its sensors, while the formation of `rescue-paper` flies: no radio, no
agents. With `--whole` a second one is of all of `rescue`, its agents and its network included. Speed is simulated
seconds per second of CPU, so other work on the machine hardly counts.
"""

import argparse
import time
from collections.abc import Iterator
from typing import Final

from fanet_mw.scenario import Scenario
from sim.run.virtual import simulate
from sim.scenarios.catalog import find
from sim.world.world import WorldActor

_ALONE: Final = {
    "kinematic": ("world.engine=kinematic",),
    "pybullet": ("world.engine=pybullet",),
    "rotors, in still air": ("world.engine=rotors",),
    "rotors, in gusts": ("world.engine=rotors", "world.wind_m_s=[4, 0]", "world.gusts_m_s=6"),
}
_WHOLE: Final = {"kinematic": ("world.engine=kinematic",), "rotors": ("world.engine=rotors",)}


def world_s(scenario: Scenario) -> float:
    """The CPU time of the world alone, for the scenario's length."""
    world = WorldActor(scenario, scenario.name)
    began_s = time.process_time()
    world.start(0)
    while (wake_ns := world.next_wake_ns()) is not None and wake_ns <= scenario.duration_ns:
        world.wake(wake_ns)
        world.outbox.clear()
        world.records.clear()
    took_s = time.process_time() - began_s
    world.stop(scenario.duration_ns)
    return took_s


def whole_s(scenario: Scenario) -> float:
    """The CPU time of a whole run, without writing its results."""
    began_s = time.process_time()
    simulate(scenario)
    return time.process_time() - began_s


def lines(seconds: float, *, whole: bool) -> Iterator[str]:
    keys = (f"duration_s={seconds}", "warmup_s=2", "drain_s=1")
    yield f"{'the world alone':24} CPU s  x real"
    for name, settings in _ALONE.items():
        took_s = world_s(find("rescue-paper", [*keys, *settings]))
        yield f"{name:24} {took_s:5.2f} {seconds / took_s:7.1f}"
    if whole:
        simulate(find("rescue", ["duration_s=4", "warmup_s=1", "drain_s=1"]))  # the kernel is loaded
        yield f"{'all of `rescue`':24} CPU s  x real"
        for name, settings in _WHOLE.items():
            took_s = whole_s(find("rescue", [*keys, *settings]))
            yield f"{name:24} {took_s:5.2f} {seconds / took_s:7.1f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0, help="simulated seconds of each run")
    parser.add_argument("--whole", action="store_true", help="whole runs of `rescue`, too")
    asked = parser.parse_args()
    for line in lines(asked.seconds, whole=asked.whole):
        print(line, flush=True)


if __name__ == "__main__":
    main()
