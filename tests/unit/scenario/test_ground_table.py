"""The post on the ground is one node more than there are UAVs."""

import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import config
from sim.world.environment.layout import positions

POST = "[nodes]\ncount = 5\n[clusters]\ncount = 1\n[ground]\nat_m = [30, -40]\nantenna_m = 7\n"


def test_a_post_has_the_id_after_those_of_the_uavs_and_stands_at_its_place() -> None:
    scenario = config.parse(POST, source="a.toml", name="a")
    assert (scenario.post, scenario.node_count) == (6, 6)
    assert list(scenario.node_ids) == [1, 2, 3, 4, 5, 6]
    assert list(scenario.uav_ids) == [1, 2, 3, 4, 5]
    assert positions(scenario)[-1] == (30, -40, 7)
    hilly = config.parse(POST + "[world]\nterrain_m = 40\n", source="a.toml", name="a")
    assert positions(hilly)[-1].up > 7


def test_without_a_post_there_are_only_uavs() -> None:
    scenario = config.parse("[nodes]\ncount = 5\n[clusters]\ncount = 1\n", source="a.toml", name="a")
    assert (scenario.post, scenario.node_count, len(positions(scenario))) == (None, 5, 5)


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ("[traffic]\ndestination = 7\n", "traffic.destination = 7 must be <= 6, the post on the ground"),
        ('[[faults]]\nkind = "cut"\nnode = 7\nat_s = 1\n', "faults.0 names node 7, which must be <= 6, the post"),
        ('[[faults]]\nkind = "crash"\nnode = 6\nat_s = 1\n', "faults.0 names node 6, which must be <= nodes.count = 5"),
        ("[world]\narea_m = 3\n", "ground.at_m = [30.0, -40.0] must be within +-10 x world.area_m = 30"),
    ],
)
def test_a_node_beyond_the_post_and_a_post_far_away_are_refused(more: str, why: str) -> None:
    with pytest.raises(ConfigError) as caught:
        config.parse(POST + more, source="a.toml", name="a")
    assert why in str(caught.value)


def test_a_place_has_two_coordinates() -> None:
    with pytest.raises(ConfigError, match=r"ground.at_m = \[30.0\] must be \[east, north\], or \[\] for no post"):
        config.parse(POST.replace("30, -40", "30"), source="a.toml", name="a")


def test_the_post_may_be_the_destination_and_cut_off() -> None:
    more = '[traffic]\ndestination = 6\n[[faults]]\nkind = "cut"\nnode = 6\nat_s = 1\n'
    assert config.parse(POST + more, source="a.toml", name="a").traffic.destination == 6
