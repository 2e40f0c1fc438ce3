"""Plans of claimed slots against whole swarms: `python tests/benchmarks/claimed_plans.py [SECONDS]`.

Scenario `clusters` (grid 9 x 5, 44 sources of 1024 B) and the same on a disc of 250 m, with claimed slots, traffic from
15 s on. `used`: what the plan says of the fullest node; a plan is feasible up to 100 %. PDR and delays as measured;
`hop`: the greatest that a node reported, beside the plan's; 10 s are left for what still waits.
"""

import sys
from collections.abc import Iterator

from agents.applications.traffic import sources_of
from fanet_mw.units import NodeId
from sim.planner import ScenarioPlan, plan
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog
from sim.world.environment.layout import positions

DISC = ("nodes.layout=disc", "nodes.radius_m=250")
CASES: tuple[tuple[str, tuple[str, ...], tuple[float, ...]], ...] = (
    ("grid", (), (1.0, 0.7, 0.6, 0.54, 0.5, 0.4)),
    ("grid, 10 slots", ("clusters.slots=10",), (1.0, 0.55, 0.47, 0.4)),
    ("disc", DISC, (1.0, 0.6, 0.45, 0.4, 0.3)),
)


HEAD = ("swarm", "interval [s]", "plan", "used", "PDR", "delay p50 / p95 [ms]", "hop, plan / greatest in flight [ms]")


def rows(seconds: float) -> Iterator[tuple[str, ...]]:
    """One row of cells for each swarm and interval."""
    for name, settings, intervals in CASES:
        for interval_s in intervals:
            yield name, f"{interval_s:g}", *_compared(settings, interval_s, seconds)


def _compared(settings: tuple[str, ...], interval_s: float, seconds: float) -> tuple[str, ...]:
    times = [f"duration_s={seconds + 25}", "warmup_s=15", "drain_s=10", f"traffic.interval_s={interval_s}"]
    scenario = catalog.find("clusters", ["clusters.relay=claimed", *settings, *times])
    at = {NodeId(i + 1): place for i, place in enumerate(positions(scenario))}
    found = plan(scenario, at, sources=[NodeId(node) for node in sources_of(scenario)])
    assert isinstance(found, ScenarioPlan)
    assert found.claims is not None
    outcome = simulate(scenario)
    summary = finish(outcome, out=None)
    hops = [r["hop_ms"] for r in outcome.reports.values() if r.get("hop_ms") is not None]
    delay = summary["delay_ms"]
    return (
        "feasible" if found.feasible else "not feasible",
        f"{100 * found.claims.fullest.utilization:.0f} %",
        f"{summary['pdr']:.4f}",
        f"{delay['p50']:.0f} / {delay['p95']:.0f}",
        f"{(found.claims.hop_ns or 0) / 1e6:.0f} / {max(hops):.0f}",
    )


def main(seconds: float) -> None:
    for row in (HEAD, *rows(seconds)):
        print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 25)
