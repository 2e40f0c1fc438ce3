"""How long a planner computes who flies to which place, and how often the swarm stays one network on the way there:
`python tests/benchmarks/keeping_together.py [SWARMS]`.

Drawn swarms of 30 to 60 UAVs that stand in crooked grids, a fifth of them out for survivors, take up lines. The node
that plans does nothing else meanwhile; the worst are swarms that cannot be joined, for which all formations are tried.
"""

import sys
import time
from random import Random

from agents.mission.search_formation.lasting_links import keep_together
from agents.mission.search_formation.pattern import fitted
from agents.mission.search_formation.shapes.contract import Demands
from fanet_mw.units import Enu

_REACH_M = 250.0
_BUSY_M2 = 500.0**2


def planned(seed: int) -> tuple[float, bool]:
    """The CPU time of one plan [ms], and whether lasting links join all."""
    drawn = Random(seed)
    count, spacing_m = drawn.choice((30, 45, 60)), drawn.choice((100.0, 120.0, 180.0, 200.0))
    side = round(count**0.5 + 0.4)
    starts = [
        Enu(spacing_m * (i % side) + drawn.uniform(-40, 40), spacing_m * (i // side) + drawn.uniform(-40, 40), 65.0)
        for i in range(count)
    ]
    middle = Enu(sum(at.east for at in starts) / count, sum(at.north for at in starts) / count, 0.0)
    starts = [at.minus(middle) for at in starts]
    busy = {uav for uav in range(count) if drawn.random() < 0.2}
    pattern = fitted(count, Demands(2500, 131, _REACH_M, 65, 7.5))
    assert pattern is not None, "so many span the area"
    followers, began_s, is_one = pattern.followers, time.process_time(), False
    for begun in pattern.begun_around(starts):
        goals = [begun.at(place, 0.0) for place in range(begun.places)]
        _, is_one = keep_together(
            starts,
            goals,
            lambda uav, place: _BUSY_M2 * (uav in busy and place not in followers),
            reach_m=_REACH_M,
            random=drawn.random,
        )
        if is_one:
            break
    return 1e3 * (time.process_time() - began_s), is_one


def main() -> None:
    flown = [planned(seed) for seed in range(int(sys.argv[1]) if len(sys.argv) > 1 else 24)]
    times_ms = sorted(ms for ms, _ in flown)
    median_ms, joined = times_ms[len(times_ms) // 2], sum(is_one for _, is_one in flown)
    print(f"{joined} of {len(flown)} joined; CPU: median {median_ms:.0f} ms, worst {times_ms[-1]:.0f} ms")


if __name__ == "__main__":
    main()
