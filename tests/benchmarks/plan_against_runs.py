"""Plans against whole swarms in virtual time: `python tests/benchmarks/plan_against_runs.py [SECONDS]`.

45 static UAVs on the reference grid, one 1024 B packet per interval from each, relays by contention. The greatest
delay of any delivery must stay below the bound of a feasible plan; losses are no part of it.
"""

import sys
from typing import NamedTuple

from fanet_mw.bounds import Bounded
from fanet_mw.scenario import config
from fanet_mw.trace import Delivered
from fanet_mw.units import NodeId, S
from sim.planner.plan import plan
from sim.planner.scenario_plan import ScenarioPlan
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.world.environment.layout import positions

CASES = ((2.0, 4, 5.0), (1.0, 4, 5.0), (1.0, 8, 2.0), (1.0, 22, 1.0), (0.5, 4, 5.0))
"""Interval [s], clusters, flooding period [s]."""


class Compared(NamedTuple):
    """A plan, and what came of it."""

    feasible: bool
    used: float
    """The fullest slot's load over its length."""
    bound_s: float | None
    greatest_delay_s: float
    pdr: float


def compared(interval_s: float, clusters: int, period_s: float, *, seconds: float) -> Compared:
    """Plans one swarm, and simulates it."""
    scenario = config.build(
        {
            "duration_s": seconds,
            "warmup_s": 8,
            "drain_s": 22,
            "nodes": {"count": 45, "telemetry_hz": 0},
            "clusters": {"count": clusters, "flooding_period_s": period_s},
            "traffic": {"payload_bytes": 1024, "interval_s": interval_s},
            "radio": {"lead_ms": 5},
        }
    )
    found = plan(scenario, {NodeId(i + 1): at for i, at in enumerate(positions(scenario))})
    assert isinstance(found, ScenarioPlan)
    outcome = simulate(scenario)
    bound = found.classes[0].bound
    return Compared(
        feasible=found.feasible,
        used=found.bottleneck.utilization if found.bottleneck else 0.0,
        bound_s=bound.delay_ns / S if isinstance(bound, Bounded) else None,
        greatest_delay_s=max(record.delay_ns for record in outcome.records if isinstance(record, Delivered)) / S,
        pdr=finish(outcome, out=None)["pdr"],
    )


def main(seconds: float) -> None:
    print("interval clusters period  plan           used %  bound s  greatest delay s  PDR")
    for interval_s, clusters, period_s in CASES:
        found = compared(interval_s, clusters, period_s, seconds=seconds)
        bound = "      -" if found.bound_s is None else f"{found.bound_s:7.2f}"
        verdict = "feasible" if found.feasible else "not feasible"
        print(
            f"{interval_s:8} {clusters:8} {period_s:6}  {verdict:14} {100 * found.used:6.0f}  {bound}  "
            f"{found.greatest_delay_s:16.2f}  {found.pdr:.3f}"
        )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 60)
