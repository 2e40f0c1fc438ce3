"""The places at which nodes start."""

import math
from collections.abc import Callable

import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from sim.world.environment.layout import positions

MakeScenario = Callable[..., Scenario]


def test_a_grid_is_centered_and_has_its_spacing(make_scenario: MakeScenario) -> None:
    keys = {"nodes.layout": "grid", "nodes.count": 12, "nodes.columns": 4, "nodes.spacing_m": 100}
    places = positions(make_scenario(**keys))
    assert sorted({place.east for place in places}) == [-150, -50, 50, 150]
    assert sorted({place.north for place in places}) == [-100, 0, 100]


def test_a_disc_is_filled_evenly(make_scenario: MakeScenario) -> None:
    """A quarter of the nodes are within half of the radius."""
    keys = {"nodes.layout": "disc", "nodes.count": 1000, "nodes.radius_m": 300}
    radii = [math.hypot(place.east, place.north) for place in positions(make_scenario(**keys))]
    assert max(radii) <= 300
    assert sum(radius <= 150 for radius in radii) / 1000 == pytest.approx(0.25, abs=0.05)


def test_a_line_is_centered(make_scenario: MakeScenario) -> None:
    keys = {"nodes.layout": "line", "nodes.count": 4, "nodes.spacing_m": 100}
    assert [place.east for place in positions(make_scenario(**keys))] == [-150, -50, 50, 150]


def test_the_leader_may_stand_in_the_middle_and_the_others_take_the_rest_in_order(make_scenario: MakeScenario) -> None:
    keys = {"nodes.layout": "grid", "nodes.count": 45, "nodes.columns": 9, "world.base_m": (0, -1750)}
    first, middle = positions(make_scenario(**keys)), positions(make_scenario(**keys, **{"nodes.leader_at": "middle"}))
    assert (middle[0].east, middle[0].north) == (0, -1750)
    assert middle[1:] == [place for place in first if place != middle[0]]


def test_a_start_below_the_ground_is_refused(make_scenario: MakeScenario) -> None:
    with pytest.raises(ConfigError, match=r"nodes.positions_m.1: up = -5 must be >= 0, the ground"):
        make_scenario(**{"nodes.count": 2, "nodes.layout": "explicit", "nodes.positions_m": ((0, 0, 5), (9, 0, -5))})
