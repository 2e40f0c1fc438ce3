"""The places of the survivors, and which of them are buried. Ids run from 1. Not modeled: survivors that move."""

import math
from collections.abc import Callable, Sequence
from random import Random
from typing import Final

import numpy as np

from fanet_mw.rng import stream
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import Enu
from sim.world.arrays import Flags, Rows, Values
from sim.world.environment.layout import positions
from sim.world.environment.obstacles import Box, covered_by, obstacles

_TRIES: Final = 200


def place(scenario: Scenario) -> list[Enu]:
    """The true positions, on flat ground: as listed, uniform over the open area, or over the floors of buildings."""
    mission = scenario.mission
    if mission.survivor_positions_m:
        return [Enu(east, north, 0.0) for east, north in mission.survivor_positions_m]
    random = stream(scenario.seed, "survivors")
    if mission.survivors_in == "buildings" and mission.survivors:
        return _in_buildings(scenario, random)
    inside = covered_by(_boxes(scenario) if scenario.world.has_obstacles and mission.survivors else ())
    return [_in_the_open(random, scenario.world.area_m / 2, inside) for _ in range(mission.survivors)]


def _in_the_open(random: Random, half_m: float, inside: Callable[[Enu], bool]) -> Enu:
    """A place outside of all buildings; any place if buildings are everywhere."""
    for _ in range(_TRIES):
        at = Enu(random.uniform(-half_m, half_m), random.uniform(-half_m, half_m), 0.0)
        if not inside(at):
            break
    return at


def _boxes(scenario: Scenario) -> Sequence[Box]:
    return obstacles(scenario, np.array(positions(scenario), dtype=np.float64)).boxes


def _in_buildings(scenario: Scenario, random: Random) -> list[Enu]:
    """A building for each survivor, larger ones with greater probability, and a place inside it."""
    boxes = _boxes(scenario)
    chosen = random.choices(boxes, weights=[box.width * box.depth for box in boxes], k=scenario.mission.survivors)
    places = []
    for box in chosen:
        along, across = (side * random.uniform(-0.5, 0.5) for side in (box.width, box.depth))
        cos, sin = math.cos(box.yaw), math.sin(box.yaw)
        places.append(Enu(box.east + cos * along - sin * across, box.north + sin * along + cos * across, 0.0))
    return places


class Survivors:
    """The survivors of a run, as sensors need them; row i is survivor i + 1."""

    places: Rows
    """Positions, on the ground."""
    buried: Flags
    """The survivors under rubble: their phones and voices are weaker outside, and cameras do not see them."""

    def __init__(self, scenario: Scenario, ground_m: Callable[[Rows], Values] | None = None) -> None:
        """`ground_m` gives the height of the ground at places [n, 3]; None means flat ground at 0."""
        count = scenario.mission.survivors
        self.places = np.array(place(scenario), dtype=np.float64).reshape(-1, 3)
        if ground_m is not None and count:
            self.places[:, 2] = ground_m(self.places)
        self.buried = np.zeros(count, bool)
        random = stream(scenario.seed, "buried")
        self.buried[random.sample(range(count), round(scenario.mission.buried * count))] = True
