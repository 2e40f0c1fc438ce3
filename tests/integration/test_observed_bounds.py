"""Bounds that an observer sees broken are those that the result counts: nodes that a bound excludes break none."""

import math
from pathlib import Path

from fanet_mw.scenario import config
from fanet_mw.trace import BoundExcludes, BoundStated, Delivered
from fanet_mw.units import S
from sim.observation.swarm_state import SwarmState
from sim.observation.timeline import Timeline
from sim.recording.tables import table
from sim.results.files import finish
from sim.results.result import Result
from sim.run.virtual import simulate

CUT = """
duration_s = 50
warmup_s = 4
drain_s = 32
[nodes]
count = 6
spacing_m = 100
[traffic]
interval_s = 1
payload_bytes = 200
priority = "report"
[routing]
protocol = "rounds"
[world]
engine = "kinematic"
area_m = 800
[[faults]]
kind = "cut"
node = 6
at_s = 9
for_s = 6
"""


def test_what_a_view_counts_as_broken_is_what_the_result_counts(tmp_path: Path) -> None:
    path = tmp_path / "cut.toml"
    path.write_text(CUT)
    scenario = config.load(path)
    state = SwarmState(scenario)
    outcome = simulate(scenario, observer=state)
    excluded = {(one.node, one.seq, one.other) for one in outcome.records if isinstance(one, BoundExcludes)}
    assert len(excluded) >= 10, "UAV 6 is known to be gone"
    bound = Result(outcome).summary["bound"]
    assert state.metrics()["bounds_broken"] == bound["violations"] > 0
    assert bound["overtaken"] == bound["violations"], "all were stated before anybody could know that UAV 6 is gone"
    finish(outcome, out=tmp_path / "run")
    bounds = {(one.node, one.seq): one.bound_ns for one in outcome.records if isinstance(one, BoundStated)}
    came_late = [
        one
        for one in outcome.records
        if isinstance(one, Delivered) and one.delay_ns > bounds.get((one.origin, one.seq), math.inf)
    ]
    broken = [one for one in came_late if (one.origin, one.seq, one.node) not in excluded]
    told = [event.t_ns for event in Timeline(tmp_path / "run").events if "broken bound" in event.text]
    assert told == [one.t_ns for one in broken]
    assert len(came_late) > len(broken), "what waited for UAV 6 came to it late, as its bounds say"
    late = [row for row in table("deliveries", outcome).to_pylist() if row["delay_ms"] > (row["bound_ms"] or math.inf)]
    assert [(row["origin"], row["seq"], row["node"]) for row in late] == [(b.origin, b.seq, b.node) for b in broken]
    born_s = [(one.t_ns - one.delay_ns) / S for one in broken]
    assert min(born_s) > 8.9, "while the air is as it was, all bounds hold"
    assert max(born_s) < 9 + 1.6 + 0.2, "after 1.6 hellos and a hop it is known"
