"""The table in docs/results/rivals.md: scenario `rivals` per protocol, speed and seed, and what geometry allows.

`conn` is an upper bound of the PDR: the share of (node, second) of the measured window in which a node has a multi-hop
path of `radio.range_m` links to the leader, on the ideal track of the mobility model.

    PYTHONPATH=. python scripts/rivals.py --protocols aodv olsr --speeds 0 10 20 --seeds 1 2 3
"""

import argparse
import statistics
import sys
from collections.abc import Sequence
from typing import Any

from fanet_mw.trace import Delivered
from sim.results.files import finish
from sim.results.links_over_time import connectivity
from sim.run.virtual import simulate
from sim.scenarios import catalog

COLUMNS = ("protocol", "m/s", "PDR (sd)", "conn", "hops", "delay ms mean / p50 / p95", "sent", "wall s", "closes")
"""`hops`: of delivered packets; `sent`: frames per packet generated; `wall`: of a run; `closes`: every frame's end."""


def row(protocol: str, speed: float, seeds: Sequence[int], keys: Sequence[str]) -> str:
    """One line of the table, over the seeds."""
    summaries: list[dict[str, Any]] = []
    bounds = []
    hops: list[float] = []
    for seed in seeds:
        changed = [f"routing.protocol={protocol}", f"mobility.speed_m_s={speed:g}", f"seed={seed}", *keys]
        scenario = catalog.find("rivals", changed)
        outcome = simulate(scenario)
        hops += [record.hops for record in outcome.records if type(record) is Delivered]
        summaries.append(finish(outcome, out=None))
        bounds.append(connectivity(scenario))
    pdr = [float(summary["pdr"]) for summary in summaries]
    delay = {name: statistics.mean(s["delay_ms"][name] or 0.0 for s in summaries) for name in ("mean", "p50", "p95")}
    sent = statistics.mean(s["frames"]["sent"] / max(1, s["generated"]) for s in summaries)
    wall = statistics.mean(s["wall_s"] for s in summaries)
    spread = statistics.stdev(pdr) if len(pdr) > 1 else 0.0
    closes = all(s["frames"]["closes"] for s in summaries)
    return (
        f"| {protocol} | {speed:g} | {statistics.mean(pdr):.3f} ({spread:.3f}) | {statistics.mean(bounds):.3f} "
        f"| {statistics.mean(hops or [0.0]):.2f} | {delay['mean']:.1f} / {delay['p50']:.1f} / {delay['p95']:.1f} "
        f"| {sent:.1f} | {wall:.1f} | {'yes' if closes else 'NO'} |"
    )


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description="Run the rivals and print their table.")
    parser.add_argument("--protocols", nargs="+", default=["aodv", "olsr"])
    parser.add_argument("--speeds", nargs="+", type=float, default=[0.0, 10.0, 20.0])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE", help="further scenario keys")
    chosen = parser.parse_args(arguments)
    sys.stdout.write(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}\n")
    for protocol in chosen.protocols:
        for speed in chosen.speeds:
            sys.stdout.write(row(protocol, speed, chosen.seeds, chosen.set) + "\n")
            sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
