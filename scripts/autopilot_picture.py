#!/usr/bin/env python
"""Draws the flight of one UAV in a run whose world were flight controllers (`fanet launch --autopilots ...`).

scripts/autopilot_picture.py FOLDER PICTURE [--uav 2]     FOLDER is that of `--out`
"""

import argparse
from collections import defaultdict
from pathlib import Path

from fanet_mw.results import records
from fanet_mw.trace import Posed
from fanet_mw.units import S
from sim.figures import colors
from sim.figures.style import applied, canvas, legend_above


def main() -> None:
    flags = argparse.ArgumentParser(description="Draws the flight of one UAV of a world of flight controllers.")
    flags.add_argument("folder", type=Path)
    flags.add_argument("picture", type=Path)
    flags.add_argument("--uav", type=int, default=2)
    given = flags.parse_args()
    tracks: dict[int, list[tuple[float, float, float, float]]] = defaultdict(list)
    for one in records(given.folder, Posed):
        tracks[one.node].append((one.t_ns / S, one.east_m, one.north_m, one.up_m))
    with applied():
        figure, (plan, height) = canvas(2, width=4.8, height=3.6)
        for node, track in sorted(tracks.items()):
            times, east, north, up = zip(*track, strict=True)
            flown = node == given.uav
            color = colors.BLUE if flown else colors.GRAY
            plan.plot(east, north, color=color, marker="o", markevery=[0], markersize=5, linewidth=1.2,
                      label="the UAV that is flown" if flown else None)  # fmt: skip
            plan.annotate(str(node), (east[0], north[0]), textcoords="offset points", xytext=(6, 6), fontsize=9)
            if flown:
                height.plot(times, up, color=color)
        legend_above(figure, plan)
        plan.set_xlabel("east [m]")
        plan.set_ylabel("north [m]")
        height.set_xlabel("time [s]")
        height.set_ylabel("height over home [m]")
        figure.savefig(given.picture, dpi=110)


if __name__ == "__main__":
    main()
