"""How a searching swarm comes home by its batteries: `python tests/benchmarks/homecomings.py`.

Ten UAVs with rotors search 600 m x 600 m from a base 400 m to the west of its middle, until their batteries tell them
to go. For each distance of the pads, speed of the wind and side from which it blows: how many stand on their pads (at
most 2 m off) at the end, how far off the others are, the least charge that is left (asked is the reserve), the time
from the first that leaves to the last that has landed, and contacts. `--set KEY=VALUE` changes the scenario.
"""

import argparse
import math
from collections.abc import Sequence

from fanet_mw.trace import Collided, MissionModeChanged, Posed
from fanet_mw.units import S
from sim.records.record_kinds import records_of
from sim.run.virtual import simulate
from sim.scenarios.catalog import find
from sim.world.environment.layout import positions

KEYS = (
    "nodes.count=10", "nodes.on_ground=true", "world.engine=rotors", "world.area_m=600", "world.base_m=[-400,0]",
    "mission.survivors=1", "sensors.battery_hz=1", "sensors.wind_hz=1", "world.charge=[0.4,0.42]",
    "traffic.arrivals=none", "clusters.count=1", "nodes.telemetry_hz=0", "duration_s=420",
)  # fmt: skip
SIDES = {"west": (1, 0), "east": (-1, 0), "south": (0, 1), "north": (0, -1)}
ON_PAD_M = 2.0
HEAD = "pads m  wind m/s from   on pads  farthest m  least charge  time s  contacts"


def line(pads_m: float, wind_m_s: float, side: str, settings: Sequence[str]) -> str:
    """One flight."""
    wind = [wind_m_s * part for part in SIDES[side]]
    scenario = find("rescue", [*KEYS, f"nodes.spacing_m={pads_m}", f"world.wind_m_s={wind}", *settings])
    outcome = simulate(scenario)
    last = {record.node: record for record in records_of(outcome.records, Posed)}
    pads = positions(scenario)
    off = [math.dist((at.east_m, at.north_m, at.up_m), pads[node - 1]) for node, at in sorted(last.items())]
    left = [r.t_ns / S for r in records_of(outcome.records, MissionModeChanged) if r.mode == "return"]
    flies = [r.t_ns / S for r in records_of(outcome.records, Posed) if r.up_m > pads[r.node - 1].up + 1.0]
    took_s = max(flies) - min(left) if left else math.nan
    contacts = sum(1 for _ in records_of(outcome.records, Collided))
    there = sum(one <= ON_PAD_M for one in off)
    charge = outcome.reports["world"]["least_charge"]
    return (
        f"{pads_m:>6g} {wind_m_s:>9g} {side:>5} {there:>5} of {len(off)} {max(off):>11.1f} {charge:>13.3f} "
        f"{took_s:>7.0f} {contacts:>9}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pads", type=float, nargs="+", default=[3, 5, 15])
    parser.add_argument("--wind", type=float, nargs="+", default=[0, 8, 15])
    parser.add_argument("--from", choices=SIDES, nargs="+", default=[*SIDES], dest="sides")
    parser.add_argument("--set", action="append", default=[], dest="settings")
    asked = parser.parse_args()
    print(HEAD)
    for pads_m in asked.pads:
        for wind_m_s in asked.wind:
            for side in asked.sides if wind_m_s else asked.sides[:1]:
                print(line(pads_m, wind_m_s, side, asked.settings), flush=True)


if __name__ == "__main__":
    main()
