"""The places of the nodes at the start. Node 1, the leader, is the first of each layout."""

import math
from typing import Final

from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario, grid_columns
from fanet_mw.units import Enu

ON_GROUND_M: Final = 0.1
"""The height of the middle of a UAV that stands on the ground."""


def positions(scenario: Scenario) -> list[Enu]:
    """The start of every node, by id: the layout about the base, and the antenna of the post on the ground."""
    places = _with_leader(_layout(scenario), scenario)
    east, north = scenario.world.base_m
    if east or north:
        places = [Enu(at.east + east, at.north + north, at.up) for at in places]
    if scenario.nodes.on_ground:
        places = _above_ground(places, ON_GROUND_M, scenario)
    if scenario.ground.at_m:
        east, north = scenario.ground.at_m
        places += _above_ground([Enu(east, north, 0.0)], scenario.ground.antenna_m, scenario)
    return places


def _above_ground(places: list[Enu], height_m: float, scenario: Scenario) -> list[Enu]:
    """These places, so high above the ground."""
    # imported here, because it brings numpy, which not every command needs
    from sim.world.environment.obstacles import terrain

    ground = terrain(scenario)
    return [
        Enu(at.east, at.north, ground.height_m(at.east, at.north) + height_m if ground else height_m) for at in places
    ]


def _with_leader(places: list[Enu], scenario: Scenario) -> list[Enu]:
    """The places with that of node 1 first, which may be the one in the middle."""
    if scenario.nodes.leader_at == "first" or scenario.nodes.layout not in ("grid", "line"):
        return places
    middle = min(range(len(places)), key=lambda i: (places[i].horizontal(), i))
    return [places[middle], *places[:middle], *places[middle + 1 :]]


def _layout(scenario: Scenario) -> list[Enu]:
    nodes = scenario.nodes
    if nodes.layout == "grid":
        columns = nodes.columns or grid_columns(nodes.count)
        rows = math.ceil(nodes.count / columns)
        west, south = -(columns - 1) * nodes.spacing_m / 2, -(rows - 1) * nodes.spacing_m / 2
        return [
            Enu(west + (i % columns) * nodes.spacing_m, south + (i // columns) * nodes.spacing_m, nodes.altitude_m)
            for i in range(nodes.count)
        ]
    if nodes.layout == "line":
        west = -(nodes.count - 1) * nodes.spacing_m / 2
        return [Enu(west + i * nodes.spacing_m, 0.0, nodes.altitude_m) for i in range(nodes.count)]
    if nodes.layout == "disc":
        return _disc(scenario)
    return [Enu(*place) for place in nodes.positions_m]


def _disc(scenario: Scenario) -> list[Enu]:
    random = stream(scenario.seed, "layout")
    places = []
    for _ in range(scenario.nodes.count):
        radius, angle = scenario.nodes.radius_m * math.sqrt(random.random()), 2 * math.pi * random.random()
        places.append(Enu(radius * math.cos(angle), radius * math.sin(angle), scenario.nodes.altitude_m))
    return places
