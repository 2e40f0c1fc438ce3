"""What `fanet plan` says of losses against a swarm whose links are near their limit."""

import pytest

from sim.cli.plan import judge
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

LINE = ['nodes.layout="line"', "nodes.count=8", "clusters.count=7", "traffic.sources=7", "radio.channel=log_distance"]


@pytest.mark.parametrize("spacing_m", [235, 245])
def test_no_more_is_lost_than_stated(spacing_m: float) -> None:
    settings = [*LINE, f"nodes.spacing_m={spacing_m}", "radio.noise_figure_db=10.5", "radio.sensitivity_dbm=-84"]
    scenario = catalog.find("clusters", [*settings, "duration_s=60", "traffic.interval_s=0.5"])
    text, plan, _ = judge(scenario)
    assert "a packet misses a node with probability" in text
    lost = 1 - finish(simulate(scenario), out=None)["pdr"]
    stated = plan["loss"]["mean"]
    assert lost <= 1.15 * stated + 0.002
    assert lost > 0.1 * stated


def test_where_no_probability_can_be_given_it_says_so() -> None:
    text, plan, _ = judge(catalog.find("clusters", ["radio.channel=log_distance", "radio.fading=nakagami"]))
    assert plan.get("loss") is None
    text, plan, _ = judge(
        catalog.find("clusters", [*LINE, "radio.fading=nakagami"]),
    )
    assert plan["loss"] is None
    assert "no probability" in text
