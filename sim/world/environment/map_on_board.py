"""The map that UAVs carry: the hills of the scenario, and those buildings that are known before the flight."""

import numpy as np

from agents.mission.navigation.onboard_map import NO_MAP, Building, OnboardMap
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from sim.world.environment.layout import positions
from sim.world.environment.obstacles import obstacles


def map_on_board(scenario: Scenario) -> OnboardMap:
    """The map; the seed decides which buildings are missing from it."""
    if not scenario.world.has_obstacles:
        return NO_MAP
    hills, boxes = obstacles(scenario, np.array(positions(scenario), dtype=np.float64))
    known = round(scenario.sensors.map_share * len(boxes))
    rows = sorted(stream(scenario.seed, "map").sample(range(len(boxes)), known))
    buildings = tuple(Building(*boxes[row]) for row in rows)
    if hills is None:
        return OnboardMap(buildings)
    return OnboardMap(buildings, tuple(tuple(row) for row in hills.heights.tolist()), hills.cell_m)
