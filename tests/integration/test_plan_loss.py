"""What `fanet plan` says of losses against a swarm whose links are near their limit."""

import pytest

from fanet_mw.trace import Delivered, Generated, LikelyStated
from fanet_mw.units import MS
from sim.planner.answer import judge
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

LINE = ['nodes.layout="line"', "nodes.count=8", "clusters.count=7", "traffic.sources=7", "radio.channel=log_distance"]


@pytest.mark.parametrize("spacing_m", [pytest.param(235, marks=pytest.mark.slow), 245])
def test_no_more_is_lost_than_stated(spacing_m: float) -> None:
    settings = [*LINE, f"nodes.spacing_m={spacing_m}", "radio.noise_figure_db=10.5", "radio.sensitivity_dbm=-84"]
    settings += ["duration_s=36", "traffic.interval_s=0.3", "clusters.resume=false"]  # what one flood loses
    scenario = catalog.find("clusters", settings)
    text, plan, _ = judge(scenario, change=False)
    assert "a packet misses a node with probability" in text
    lost = 1 - finish(simulate(scenario), out=None)["pdr"]
    stated = plan["loss"]["mean"]
    assert lost <= 1.15 * stated + 0.002
    assert lost > 0.1 * stated


@pytest.mark.slow
def test_a_timetable_that_counts_on_links_which_the_channel_does_not_carry_is_not_feasible() -> None:
    """With such a range floods end where the timetable sends no relay; a shorter `link_m` makes all of them arrive."""
    far = ["nodes.count=9", "nodes.columns=3", "nodes.spacing_m=210", "clusters.count=8", "traffic.sources=8",
           "radio.channel=log_distance", "radio.rate_mbps=2", "radio.range_m=700"]  # fmt: skip
    text, plan, feasible = judge(catalog.find("clusters", far))
    assert not feasible
    assert "counts on links of up to 700 m, and this channel delivers up to" in " ".join(text.split())
    flight = ["warmup_s=16", "duration_s=22", "drain_s=2"]
    assert finish(simulate(catalog.find("clusters", [*far, *flight])), out=None)["pdr"] < 0.9
    change = plan["change"]["set"]
    assert any(setting.startswith("clusters.link_m=") for setting in change)
    (bound_ms,) = (c["bound_ms"] for c in plan["change"]["classes"])
    flown = finish(simulate(catalog.find("clusters", [*far, *change, *flight])), out=None)
    assert flown["pdr"] == 1.0
    assert flown["delay_ms"]["max"] <= bound_ms


def test_where_no_probability_can_be_given_it_says_so() -> None:
    text, plan, _ = judge(catalog.find("clusters", [*LINE, "radio.fading=nakagami", 'clusters.links="places"']))
    assert plan["loss"] is None
    assert "no probability" in text


# --- links that are measured in flight ----------------------------------------------------------------------------

SMALL = ["nodes.count=12", "clusters.count=11", "traffic.sources=11", "radio.channel=log_distance"]


@pytest.mark.parametrize("loss", ["radio.fading=rician", pytest.param("radio.shadowing_db=4", marks=pytest.mark.slow)])
def test_over_lossy_links_a_plan_promises_a_likely_delay_and_no_bound(loss: str) -> None:
    text, plan, feasible = judge(catalog.find("clusters", [*SMALL, loss]))
    assert feasible
    assert "at most" not in text
    assert "0.99 of the nodes have a packet within" in text
    flown = simulate(catalog.find("clusters", [*SMALL, loss, "duration_s=40", "warmup_s=24", "drain_s=8"]))
    born = {(r.node, r.seq): r.t_ns for r in flown.records if isinstance(r, Generated)}
    delays = [r.t_ns - born[r.origin, r.seq] for r in flown.records if isinstance(r, Delivered)]
    assert sum(delay_ns <= plan["likely_ms"] * MS for delay_ns in delays) >= 0.99 * 11 * len(born)
    stated = [record.delay_ns / MS for record in flown.records if isinstance(record, LikelyStated)]
    assert 0.5 * max(stated) <= plan["likely_ms"] <= 2 * max(stated), "about what the nodes state themselves"


def test_a_plan_says_when_repeated_frames_find_no_turns() -> None:
    crowded = catalog.find("clusters", [*SMALL, "radio.fading=rician", "traffic.interval_s=0.02"])
    _, plan, feasible = judge(crowded)
    assert not feasible
    assert plan["likely_ms"] is None
    (problem,) = plan["problems"]
    assert "the turns do not hold the load with its repeated frames" in problem


def test_a_deadline_is_held_against_the_likely_delay() -> None:
    lossy = catalog.find("clusters", [*SMALL, "radio.fading=rician"])
    assert not judge(lossy, deadline_s=0.1)[2]
    assert judge(lossy, deadline_s=60.0)[2]
