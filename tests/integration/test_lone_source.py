"""A swarm in which one node alone has traffic, and says so: the air is that node's, and its bound holds."""

from typing import Any

from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

GRID = ["nodes.count=12", "clusters.count=11", "traffic.sources=[4]", "duration_s=15", "warmup_s=11", "drain_s=1"]


def summary_of(*settings: str) -> dict[str, Any]:
    return finish(simulate(catalog.find("clusters", [*GRID, *settings])), out=None)


def test_a_lone_source_has_the_turns_that_others_do_not_need() -> None:
    """A hundred packets a second, each of a millisecond, over seven relays."""
    summary = summary_of("traffic.interval_s=0.01")
    bound = summary["bound"]
    assert summary["pdr"] == bound["stated_share"] == bound["within_share"] == 1.0
    assert bound["violations"] == 0
    assert bound["worst_ms"] < 150
