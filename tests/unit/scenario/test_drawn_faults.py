"""Faults that the seed draws."""

import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.scenario.drawn_faults import with_drawn_faults
from sim.scenarios import catalog


def test_each_befalls_another_uav_while_there_is_time_to_see_what_becomes_of_it() -> None:
    scenario = catalog.find("rescue", [])
    drawn = with_drawn_faults(scenario, "random:20").faults
    assert len({fault.node for fault in drawn}) == 20  # type: ignore[union-attr]
    assert {fault.kind for fault in drawn} == {"crash", "mute", "stop"}
    instants_s = [fault.at_s for fault in drawn]
    assert instants_s == sorted(instants_s)
    assert instants_s[0] >= 30
    assert instants_s[-1] <= 240
    assert with_drawn_faults(scenario, "random:20").faults == drawn
    assert with_drawn_faults(catalog.find("rescue", ["seed=2"]), "random:20").faults != drawn


def test_the_scenarios_own_remain() -> None:
    scenario = catalog.find("convoy", [])
    assert with_drawn_faults(scenario, "random:1").faults[:1] == scenario.faults


@pytest.mark.parametrize("asked", ["random:0", "random:45", "random:-1", "random:x", "random", "5", ""])
def test_a_number_that_cannot_be_is_refused_with_its_bound(asked: str) -> None:
    with pytest.raises(ConfigError, match=r"--faults .*: must be random:N, with 1 <= N < nodes.count = 45"):
        with_drawn_faults(catalog.find("rescue", []), asked)
