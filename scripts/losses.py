#!/usr/bin/env python
"""Fly searches in which UAVs are lost, and print how each swarm heals: `python scripts/losses.py SEED ...`.

Each seed draws the UAVs, the instants and the kinds (crash, mute, program stopped), as `--faults random:N` does.

    again s    from a loss to the instant from which the others were one network again: the end of the last stretch
               apart that began within 30 s of it; 0 if they were never apart
    apart      all stretches in which they were not one network, by the true positions once a second
    connected  share of the time after the first loss in which they were one network
    reached    deliveries of reports and traffic, of what an ideal flood could have delivered over the links there were

`--scenario NAME`, `--set KEY=VALUE` and `--losses N` fly others; `--every S` draws only the UAVs, and loses one every S
seconds from 40 s on. `--draw DIR` draws three instants of each flight that was apart for more than 15 s at once.
"""

import argparse
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from fanet_mw.scenario import Scenario  # noqa: E402  (the tree's root is on the path now)
from fanet_mw.scenario.config import build  # noqa: E402
from fanet_mw.scenario.drawn_faults import with_drawn_faults  # noqa: E402
from fanet_mw.units import S  # noqa: E402
from scripts.healing import draw  # noqa: E402
from sim.figures.style import applied, canvas  # noqa: E402
from sim.results.coherence import coherence  # noqa: E402
from sim.results.files import finish  # noqa: E402
from sim.results.mission import searching_instants  # noqa: E402
from sim.run.virtual import simulate  # noqa: E402
from sim.scenarios.catalog import find  # noqa: E402

WITHIN_S: Final = 30
ASKED_S: Final = 15
FIRST_S: Final = 40


class Flight(NamedTuple):
    """What became of one swarm."""

    losses: list[tuple[float, str, int]]
    """The instant [s], the kind and the UAV of each loss."""
    apart: list[tuple[int, int]]
    """The stretches in which the others were not one network: the first second, and that after the last."""
    connected: float
    summary: dict[str, Any]

    @property
    def again_s(self) -> list[float]:
        """How long after each loss the others were one network again."""
        return [
            max((end - at_s for begin, end in self.apart if -1 <= begin - at_s <= WITHIN_S), default=0.0)
            for at_s, _, _ in self.losses
        ]


def with_losses(scenario: Scenario, *, count: int, every_s: float | None) -> Scenario:
    """The scenario with drawn losses."""
    drawn = with_drawn_faults(scenario, f"random:{count}")
    if every_s is None:
        return drawn
    tree = drawn.model_dump(mode="json", exclude_none=True)
    tree["faults"] = [{**fault, "at_s": FIRST_S + every_s * rank} for rank, fault in enumerate(tree["faults"])]
    return build(tree)


def flown(scenario: Scenario, drawing: Path | None) -> Flight:
    """One flight, drawn into this file if it was apart for too long."""
    outcome = simulate(scenario)
    losses = [(fault.at_s, fault.kind, getattr(fault, "node", 0)) for fault in scenario.faults]
    places, torn = {}, []
    for t_ns, at, searching in searching_instants(outcome.records):
        second = t_ns // S
        near = np.linalg.norm(at[:, None] - at[None], axis=2)[np.ix_(searching, searching)] <= scenario.radio.range_m
        places[second] = {rank: (east, north) for rank, (east, north, _) in enumerate(at[searching].tolist())}
        if not coherence(near).connected:
            torn.append(second)
    apart: list[tuple[int, int]] = []
    for second in torn:
        if apart and apart[-1][1] == second:
            apart[-1] = apart[-1][0], second + 1
        else:
            apart.append((second, second + 1))
    first_s = min(at_s for at_s, _, _ in losses)
    after = [second for second in places if second >= first_s]
    share = 1 - len([second for second in torn if second >= first_s]) / max(1, len(after))
    longest = max(apart, key=lambda one: one[1] - one[0], default=None)
    if drawing is not None and longest is not None and longest[1] - longest[0] > ASKED_S:
        _picture(scenario, places, longest, drawing)
    return Flight(losses, apart, share, finish(outcome, out=None))


def _picture(
    scenario: Scenario, places: dict[int, dict[int, tuple[float, float]]], apart: tuple[int, int], out: Path
) -> None:
    half = scenario.world.area_m / 2 + 30
    with applied():
        figure, axes = canvas(3, 1, width=3.6, height=3.8)
        for panel, second in zip(
            axes, (apart[0] - 1, (apart[0] + apart[1]) // 2, min(apart[1] + 3, max(places))), strict=True
        ):
            parts = draw(panel, places[second], 0, (0.0, 0.0), crashed=False, reach_m=scenario.radio.range_m)
            panel.set(xlim=(-half, half), ylim=(-half, half), title=f"{second} s: {parts} part(s)")
        figure.savefig(out, dpi=110)


def line(seed: int, flight: Flight) -> str:
    mission, reached = flight.summary["mission"], flight.summary.get("reachable", {})
    bound = flight.summary["bound"]
    shares = " ".join(f"{name} {one['pdr']:.3f}" for name, one in reached.items() if one["pdr"] is not None)
    lost = ", ".join(f"{kind} {node} at {at_s:g}" for at_s, kind, node in flight.losses)
    apart = " ".join(f"{begin}-{end}" for begin, end in flight.apart) or "never"
    again = "/".join(f"{again_s:.0f}" for again_s in flight.again_s)
    return (
        f"{seed:>4} | {lost} | again {again} s | apart {apart} | connected {flight.connected:.3f} | "
        f"{mission['confirmed']} of {mission['survivors']} | reached {shares} | "
        f"bounds broken {bound.get('violations', 0)} | contacts {mission['collisions']}"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", nargs="+", type=int)
    parser.add_argument("--scenario", default="rescue")
    parser.add_argument("--set", action="append", default=[], dest="settings")
    parser.add_argument("--losses", type=int, default=1)
    parser.add_argument("--every", type=float)
    parser.add_argument("--draw", type=Path)
    asked = parser.parse_args(arguments)
    flights = []
    for seed in asked.seeds:
        scenario = find(asked.scenario, [*asked.settings, f"seed={seed}"])
        drawing = None if asked.draw is None else asked.draw / f"{asked.scenario}-{seed}.png"
        flights.append(flown(with_losses(scenario, count=asked.losses, every_s=asked.every), drawing))
        print(line(seed, flights[-1]), flush=True)
    again = [again_s for flight in flights for again_s in flight.again_s]
    print(
        f"{len(flights)} flights: one network again within {ASKED_S} s in {sum(one <= ASKED_S for one in again)} of "
        f"{len(again)}, median {statistics.median(again):.0f} s, worst {max(again):.0f} s; connected "
        f"{statistics.fmean(flight.connected for flight in flights):.3f} on average, least "
        f"{min(flight.connected for flight in flights):.3f}; everyone found in "
        f"{sum(f.summary['mission']['confirmed'] == f.summary['mission']['survivors'] for f in flights)}; "
        f"contacts {sum(flight.summary['mission']['collisions'] for flight in flights)}"
    )


if __name__ == "__main__":
    main()
