#!/usr/bin/env python
"""Draw the heights above ground of a swarm over steep hills into docs/explanation/terrain-heights.png, and print them.

It flies 20 UAVs over 1 km2 of hills of 150 m; with the folder of a run (`fanet simulate --out`) it draws that one.
`python scripts/terrain_heights.py [RUN]` (needs matplotlib).
"""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from agents.mission.navigation.onboard_map import OnboardMap  # noqa: E402  (the tree's root is on the path now)
from fanet_mw.scenario.config import load  # noqa: E402
from fanet_mw.trace import Posed  # noqa: E402
from fanet_mw.units import S  # noqa: E402
from sim.figures.colors import BLUE, GRAY, RED  # noqa: E402
from sim.figures.style import applied, canvas  # noqa: E402
from sim.results.run_folder import read_trace  # noqa: E402
from sim.run.virtual import simulate  # noqa: E402
from sim.scenarios.catalog import find  # noqa: E402
from sim.world.environment.map_on_board import map_on_board  # noqa: E402

OUT: Final = ROOT / "docs" / "explanation" / "terrain-heights.png"
STEEP: Final = (
    "nodes.count=20 nodes.on_ground=true nodes.spacing_m=10 world.area_m=1000 world.terrain_m=150 "
    "world.terrain_scale_m=250 mission.survivors=8 traffic.interval_s=100000 duration_s=140"
)
WITHIN_M: Final = 15.0
UP_S: Final = 40.0
"""From then on everybody has taken off."""


def heights(ground: OnboardMap, poses: Iterable[Posed]) -> dict[int, list[tuple[float, float]]]:
    """The instants and heights above ground of each UAV."""
    flown: dict[int, list[tuple[float, float]]] = {}
    for pose in poses:
        height = pose.up_m - ground.ground_m(pose.east_m, pose.north_m)
        flown.setdefault(pose.node, []).append((pose.t_ns / S, height))
    return flown


def main() -> None:
    if len(sys.argv) > 1:
        folder = Path(sys.argv[1])
        scenario, poses = load(folder / "scenario.toml"), read_trace(folder, Posed)
    else:
        scenario = find("hills", STEEP.split())
        poses = (record for record in simulate(scenario).records if isinstance(record, Posed))
    wanted_m, flown = scenario.nodes.altitude_m, heights(map_on_board(scenario), poses)
    settled = np.array([height for way in flown.values() for at_s, height in way if at_s >= UP_S])
    share = float(np.mean(np.abs(settled - wanted_m) <= WITHIN_M))
    lowest, *middle, highest = np.percentile(settled, [0, 1, 50, 99, 100])
    print(
        f"height above ground from {UP_S:g} s on: {lowest:.0f} to {highest:.0f} m; 1, 50, 99 %: "
        f"{', '.join(f'{m:.0f}' for m in middle)} m; within {WITHIN_M:g} m of {wanted_m:g} m: {share:.1%}"
    )
    with applied():
        figure, (axes,) = canvas(width=8, height=3.4)
        for way in flown.values():
            axes.plot(*zip(*way, strict=True), color=BLUE, linewidth=0.6, alpha=0.6)
        axes.axhline(wanted_m, color=GRAY, linewidth=1)
        for bound_m in (wanted_m - WITHIN_M, wanted_m + WITHIN_M):
            axes.axhline(bound_m, color=RED, linestyle="--", linewidth=1)
        axes.set(xlabel="time [s]", ylabel="height above ground [m]", ylim=(0, None))
        figure.savefig(OUT, dpi=100, metadata={"Software": None})


if __name__ == "__main__":
    main()
