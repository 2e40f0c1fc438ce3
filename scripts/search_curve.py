#!/usr/bin/env python
"""Draw how long N UAVs need to cover 95 % of a square kilometre into docs/explanation/search-curve.png, and print it.

From the plans alone, with no air and no wind: the ways to the places, and the sweep. Beside it stands area / (N x
distance of lanes x speed), after the longest of these ways; receivers reach beyond half a lane, so a sweep may be
sooner. `python scripts/search_curve.py` (needs matplotlib).
"""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.ticker import FixedLocator, NullLocator, ScalarFormatter

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from agents.mission.flight.take_off import take_off_ns  # noqa: E402  (the tree's root is on the path now)
from agents.mission.hungarian import assign  # noqa: E402
from agents.mission.search_formation.pattern import Pattern  # noqa: E402
from agents.mission.searcher import formation  # noqa: E402
from fanet_mw.errors import ConfigError  # noqa: E402
from fanet_mw.scenario import Scenario  # noqa: E402
from fanet_mw.units import Enu, S  # noqa: E402
from sim.figures.colors import BLUE, GRAY, ORANGE, RED  # noqa: E402
from sim.figures.style import applied, canvas  # noqa: E402
from sim.results.mission import CoveredCells  # noqa: E402
from sim.scenarios import catalog  # noqa: E402
from sim.world.environment.layout import positions  # noqa: E402

OUT: Final = ROOT / "docs" / "explanation" / "search-curve.png"
AIR: Final = ("nodes.spacing_m=100",)
BASE: Final = ("nodes.on_ground=true", "nodes.spacing_m=15", "world.base_m=[0,-600]")
COUNTS: Final = (*range(1, 21), 25, 30, 35, 40, 45, 50, 60, 70, 80, 90, 100)
DEPLOY_M_S: Final = 9.0
"""The speed at which the planner lets UAVs fly to their places."""
STEP_S: Final = 1.0


def scenario(count: int, search: str, start: Sequence[str]) -> Scenario:
    keys = ("world.area_m=1000", "ground.at_m=[]", "mission.survivors=1", "clusters.count=1", "traffic.sources=1")
    return catalog.find("rescue", [*keys, *start, f"nodes.count={count}", f"mission.search={search}"])


def way_s(made: Scenario, pattern: Pattern) -> float:
    """The time of the take-off and of the longest way to a place."""
    starts = [Enu(*at) for at in positions(made)][: pattern.places]
    goals = [pattern.at(place, 0.0) for place in range(pattern.places)]
    ways = [[start.horizontal_to(goal) for goal in goals] for start in starts]
    chosen = assign([[way * way for way in row] for row in ways])
    longest_m = max(ways[row][column] for row, column in enumerate(chosen))
    climb_s = take_off_ns(made.nodes.altitude_m) / S if made.nodes.on_ground else 0.0
    return climb_s + longest_m / DEPLOY_M_S


def covered_95_s(made: Scenario, pattern: Pattern) -> float:
    """The time of the sweep until 95 % of the area were within the range of a receiver."""
    cells, swept_s = CoveredCells(made), 0.0
    while cells.share < 0.95:
        cells.add(pattern.at(place, swept_s) for place in range(pattern.places))
        swept_s += STEP_S
    return swept_s


def row(count: int, search: str, start: Sequence[str]) -> tuple[float, float] | None:
    """The time to 95 %, and that by lanes; None if the UAVs are too few for this shape."""
    try:
        made = scenario(count, search, start)
    except ConfigError:
        return None
    pattern = formation(made, count)
    assert pattern is not None, "the catalog refuses a search that cannot be flown"
    if search in ("ring", "fan") and pattern.dimensions.shape.name.lower() != search:
        return None
    pattern = pattern.begun_around([Enu(*at) for at in positions(made)])[0]
    there_s = way_s(made, pattern)
    lane_m = 1.35 * math.sqrt(cells_range_m(made) ** 2 - made.nodes.altitude_m**2)
    by_lanes_s = made.world.area_m**2 / (count * lane_m * made.mobility.speed_m_s)
    return there_s + covered_95_s(made, pattern), there_s + by_lanes_s


def cells_range_m(made: Scenario) -> float:
    mission = made.mission
    return 10 ** ((mission.phone_power_dbm - 40.05 - mission.detection_dbm) / (10 * mission.phone_exponent))


def main() -> None:
    """Print and draw the curves."""
    with applied():
        figure, axes = canvas(1, 2, width=7.5, height=3.0)
        panels = (("from the air", AIR, "ring"), ("from a base, 100 m off", BASE, "fan"))
        for panel, (title, start, other) in zip(axes, panels, strict=True):
            for search, color, mark in (("fastest", BLUE, "o"), ("lines", RED, "s"), (other, ORANGE, "^")):
                rows = [(count, found) for count in COUNTS if (found := row(count, search, start)) is not None]
                counts = np.array([count for count, _ in rows])
                times, by_lanes = np.array([found for _, found in rows]).T
                panel.plot(counts, times, color=color, marker=mark, markersize=3, label=search)
                if search == "fastest":
                    panel.plot(counts, by_lanes, color=GRAY, linestyle=":", label="area / (N lane speed)")
                for count, (time_s, by_lanes_s) in rows:
                    # the way of a fan is a part of its search
                    of_that = "" if search == "fan" else f", {time_s / by_lanes_s:.2f} of area / (N lane speed)"
                    print(f"{title}: {count} UAVs, {search}: {time_s:.0f} s{of_that}")
            panel.set(title=title, xlabel="UAVs", yscale="log", xscale="log")
            for axis, ticks in ((panel.xaxis, (1, 2, 5, 10, 20, 50)), (panel.yaxis, (20, 50, 100, 200, 500))):
                axis.set_major_locator(FixedLocator(ticks))
                axis.set_major_formatter(ScalarFormatter())
                axis.set_minor_locator(NullLocator())
            panel.legend()
        axes[0].set_ylabel("95 % covered after [s]")
        figure.savefig(OUT, dpi=150, metadata={"Software": None})


if __name__ == "__main__":
    main()
