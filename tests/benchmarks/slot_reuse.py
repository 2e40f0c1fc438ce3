"""Superframe length against number of UAVs at constant density: `python tests/benchmarks/slot_reuse.py`.

Every UAV owns one slot; no two within two hops share one (checked). Layouts: the reference grid (200 m, range 250 m: 4
neighbors), and uniform places at the same number per area (far from even). The superframe is as many slots as the
highest claim needs; without reuse it is one slot per UAV. For the claims over the air: superframes until no clash
is left, all nodes starting at once, without and with 20 % of the hellos lost.
"""

import math
import sys
from pathlib import Path
from time import perf_counter

sys.path += [str(Path(__file__).parents[1] / "property"), str(Path(__file__).parents[1])]  # with its kit.py

from coloring import clashes, dsatur, welsh_powell
from test_slots_with_reuse import LISTEN, Air

from fanet_mw.graph.topology import Adjacency, two_hop, within_range
from fanet_mw.rng import stream
from fanet_mw.scenario import grid_columns
from fanet_mw.units import Enu, NodeId

SPACING_M = 200.0
RANGE_M = 250.0
LIMIT = 300


def grid(count: int) -> Adjacency:
    columns = grid_columns(count)
    places = {NodeId(i + 1): Enu(SPACING_M * (i % columns), SPACING_M * (i // columns), 0.0) for i in range(count)}
    return within_range(places, range_m=RANGE_M)


def uniform(count: int, seed: int) -> Adjacency:
    rng, side = stream(seed, "uniform", count), SPACING_M * math.sqrt(count)
    places = {NodeId(i + 1): Enu(rng.uniform(0, side), rng.uniform(0, side), 0.0) for i in range(count)}
    return within_range(places, range_m=RANGE_M)


def length(slots, adjacency: Adjacency) -> int:
    assert not clashes(slots, adjacency)
    return max(slots.values()) + 1


def claimed(adjacency: Adjacency, loss: float) -> tuple[int, int]:
    """Superframe length of the claims, and superframes until the last clash was gone."""
    air = Air(adjacency, seed=1, loss=loss)
    last = 0
    while air.superframe < LIMIT and air.superframe < max(40, 2 * last):
        air.run(1)
        if not air.settled:
            last = air.superframe
    return length(air.slots, adjacency), last + 1


def main() -> None:
    print("layout   UAVs neighbors conflicts  welsh-powell  dsatur (ms)   claims (superframes)  20 % lost")
    for name in ("grid", "uniform"):
        for count in (45, 100, 200, 500, 1000):
            adjacency = grid(count) if name == "grid" else uniform(count, seed=1)
            neighbors = sum(len(n) for n in adjacency.values()) / count
            conflicts = max(len(n) for n in two_hop(adjacency).values())
            began = perf_counter()
            best = length(dsatur(adjacency), adjacency)
            ms = 1000 * (perf_counter() - began)
            claims, lossy = claimed(adjacency, 0.0), claimed(adjacency, 0.2)
            print(
                f"{name:8} {count:4} {neighbors:9.1f} {conflicts:9} {length(welsh_powell(adjacency), adjacency):13} "
                f"{best:7} ({ms:.0f}) {claims[0]:8} ({claims[1]}) {lossy[0]:14} ({lossy[1]})"
            )
    print(f"superframes count from the start, {LISTEN} of listening included")


if __name__ == "__main__":
    main()
