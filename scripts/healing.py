#!/usr/bin/env python
"""Draw how a swarm heals into docs/results/pictures/healing.png: 20 UAVs search a square kilometre, a relay crashes.

Three instants of one flight in virtual time (seed 1): before the crash, while the others are apart, and when they are
one network again. `python scripts/healing.py` flies it twice, half a minute of work (needs matplotlib).
"""

import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from matplotlib.axes import Axes

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from fanet_mw.trace import Planned, Posed  # noqa: E402  (the tree's root is on the path now)
from fanet_mw.units import S  # noqa: E402
from sim.figures.colors import BLUE, GRAY, ORANGE, RED  # noqa: E402
from sim.figures.style import applied, canvas  # noqa: E402
from sim.run.virtual import simulate  # noqa: E402
from sim.scenarios import catalog  # noqa: E402

OUT: Final = ROOT / "docs" / "results" / "pictures" / "healing.png"
KEYS: Final = (
    "nodes.count=20", "nodes.spacing_m=100", "nodes.telemetry_hz=0", "world.area_m=1000", "mission.survivors=4",
    "traffic.arrivals=none", "duration_s=120",
)  # fmt: skip
CRASH_S: Final = 94
PLACE: Final = 13
"""A relay in the middle of the chain of four."""
Places = Mapping[int, tuple[float, float]]


def tracks(*keys: str) -> tuple[dict[int, Places], dict[int, int]]:
    """The places of all UAVs at each second, and who took which place of the plan."""
    at: dict[int, dict[int, tuple[float, float]]] = {}
    holders: dict[int, int] = {}
    for record in simulate(catalog.find("rescue", [*KEYS, *keys])).records:
        if isinstance(record, Posed):
            at.setdefault(record.t_ns // S, {})[record.node] = (record.east_m, record.north_m)
        elif isinstance(record, Planned):
            holders.setdefault(record.place, record.node)
    return dict(at), holders


def parts(places: Places, reach_m: float) -> list[set[int]]:
    """The connected parts of a swarm, the largest first."""
    left, found = set(places), []
    while left:
        part, edge = set[int](), [left.pop()]
        while edge:
            here = edge.pop()
            part.add(here)
            near = {other for other in left if math.dist(places[here], places[other]) <= reach_m}
            left -= near
            edge += near
        found.append(part)
    return sorted(found, key=len, reverse=True)


def draw(axes: Axes, places: Places, lost: int, where: tuple[float, float], *, crashed: bool, reach_m: float) -> int:
    """One instant, with the lost UAV `where` it was last; returns the number of parts of the others."""
    alive = {node: at for node, at in places.items() if node != lost or not crashed}
    found = parts(alive, reach_m)
    for one, here in alive.items():
        for other, there in alive.items():
            if one < other and math.dist(here, there) <= reach_m:
                axes.plot(*zip(here, there, strict=True), color=GRAY, linewidth=0.5, zorder=1)
    for part, color in zip(found, (BLUE, ORANGE, RED, RED), strict=False):
        axes.scatter(*zip(*(alive[node] for node in sorted(part)), strict=True), color=color, s=14, zorder=2)
    axes.scatter(*where, color=RED, marker="x" if crashed else "o", s=40 if crashed else 14, zorder=3)
    axes.set(xlim=(-520, 520), ylim=(-520, 520), aspect="equal", xlabel="east [m]")
    return len(found)


def main() -> None:
    """Fly twice and draw."""
    _, holders = tracks("duration_s=30")
    lost = holders[PLACE]
    fault = f'faults=[{{kind="crash", at_s={CRASH_S}, node={lost}}}]'
    at, _ = tracks(fault)
    reach_m = catalog.find("rescue", [*KEYS]).radio.range_m
    others = {t_s: {n: p for n, p in places.items() if n != lost} for t_s, places in at.items()}
    torn = [t_s for t_s in sorted(others) if t_s > CRASH_S and len(parts(others[t_s], reach_m)) > 1]
    worst_s = torn[len(torn) // 2] if torn else CRASH_S + 2
    healed_s = (torn[-1] + 1) if torn else CRASH_S + 5
    print(f"UAV {lost} crashes at {CRASH_S} s; torn for {len(torn)} s; one network again at {healed_s} s")
    with applied():
        figure, axes = canvas(3, 1, width=2.7, height=2.9)
        for panel, t_s in zip(axes, (CRASH_S - 1, worst_s, healed_s + 5), strict=True):
            count = draw(panel, at[t_s], lost, at[min(t_s, CRASH_S - 1)][lost], crashed=t_s > CRASH_S, reach_m=reach_m)
            panel.set_title(f"{t_s} s: {'one network' if count == 1 else f'{count} parts'}")
        axes[0].set_ylabel("north [m]")
        figure.savefig(OUT, dpi=130, metadata={"Software": None})


if __name__ == "__main__":
    main()
