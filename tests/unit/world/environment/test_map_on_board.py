"""The map that UAVs carry shows what stands in the world, as far as it is known."""

from collections.abc import Callable

import numpy as np
import pytest

from agents.mission.navigation.onboard_map import NO_MAP
from fanet_mw.scenario import Scenario
from sim.world.environment.layout import positions
from sim.world.environment.map_on_board import map_on_board
from sim.world.environment.obstacles import obstacles
from sim.world.environment.solids import Solids

MakeScenario = Callable[..., Scenario]
KEYS = {"world.area_m": 800, "world.buildings": 20, "world.terrain_m": 15.0, "nodes.altitude_m": 100}


def test_the_map_has_the_ground_and_the_walls_of_the_world(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**KEYS)
    solids = Solids(obstacles(scenario, np.array(positions(scenario))))
    onboard_map = map_on_board(scenario)
    places = np.random.default_rng(1).uniform(-390, 390, (200, 3))
    places[:, 2] = 20.0
    ground = [onboard_map.ground_m(east, north) for east, north, _ in places.tolist()]
    assert ground == pytest.approx(solids.ground_m(places).tolist())
    inside = [
        any(b.roof_m > 20 and b.outside(east, north)[0] < 0 for b in onboard_map.buildings)
        for east, north, _ in places.tolist()
    ]
    ground_gap = places[:, 2] - solids.ground_m(places)
    assert inside == [gap == 0 and over > 0 for gap, over in zip(solids.gap_m(places), ground_gap, strict=True)]
    assert any(inside)


def test_some_of_the_buildings_may_be_missing_from_the_map(make_scenario: MakeScenario) -> None:
    whole = map_on_board(make_scenario(**KEYS))
    part = map_on_board(make_scenario(**KEYS, **{"sensors.map_share": 0.75}))
    assert len(part.buildings) == 15
    assert set(part.buildings) < set(whole.buildings)
    assert map_on_board(make_scenario()) is NO_MAP
