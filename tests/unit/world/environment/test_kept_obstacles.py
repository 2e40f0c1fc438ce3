"""What a seed's world makes of hills and buildings is the same in every release: heights, gaps, rays, stops."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from kept_values import kept

from fanet_mw.scenario import Scenario
from sim.world.environment.layout import positions
from sim.world.environment.line_of_sight import Sight, loss_db
from sim.world.environment.map_on_board import map_on_board
from sim.world.environment.obstacles import obstacles
from sim.world.environment.solids import Solids
from sim.world.environment.survivors import Survivors
from sim.world.environment.wind import Wind

MakeScenario = Callable[..., Scenario]
KNIFE_EDGES = {"radio.channel": "friis", "radio.obstruction_loss_db": "knife_edge"}
WORLDS: dict[str, dict[str, Any]] = {
    "plain": {},
    "town": {"world.buildings": 25, "mission.survivors": 6},
    "hills": {"world.terrain_m": 40, "mission.survivors": 6, "mission.buried": 0.4, **KNIFE_EDGES},
    "both": {"world.buildings": 12, "world.terrain_m": 25, "nodes.layout": "disc", "nodes.altitude_m": 60},
    "edges": {"world.buildings": 25, "nodes.altitude_m": 20, **KNIFE_EDGES},
    "given": {"world.buildings": [[0, 0, 30, 20, 25], [60, 40, 10, 50, 40], [-80, 10, 25, 25, 12]]},
}


@pytest.mark.parametrize("name", WORLDS)
def test_obstacles_are_what_they_were_before(make_scenario: MakeScenario, name: str) -> None:
    scenario = make_scenario(**{"world.area_m": 300, "nodes.count": 9, "nodes.spacing_m": 30, "seed": 3} | WORLDS[name])
    starts = np.array(positions(scenario), dtype=np.float64)
    found = obstacles(scenario, starts)
    turned = tuple(box._replace(yaw=0.3 * number) for number, box in enumerate(found.boxes))
    solids, drawn = Solids(found._replace(boxes=turned)), np.random.default_rng(7)
    at = drawn.uniform([-160, -160, 0], [160, 160, 60], (300, 3))
    to = at + drawn.normal(0, 25, at.shape)
    direction = (to - at) / np.linalg.norm(to - at, axis=1)[:, None]

    def values() -> Iterator[Any]:
        yield starts, found.boxes, found.top_m, map_on_board(scenario)
        if found.hills:
            yield (
                found.hills.heights[::7, ::5],
                found.hills.normals(at),
                found.hills.steepest,
                [part[::13] for part in found.hills.mesh()],
            )
        yield solids.ground_m(at), solids.surface_m(at), solids.gap_m(at), solids.nearest_walls(at[0])
        yield solids.least_gap_m(at, to, within_m=8.0), solids.blocked(at, to), solids.first_hit_m(at, direction, 90.0)
        after, velocity = to.copy(), (to - at) * 3
        yield solids.stop(at, after, velocity), after, velocity
        yield loss_db(solids, at[:100], to[100:200], wavelength_m=0.12)
        yield Sight(scenario, solids).obstructions(at[:9], 0)
        if scenario.mission.survivors:
            survivors = Survivors(scenario, solids.ground_m)
            yield survivors.places, survivors.buried

    kept(f"obstacles, {name}", values())


@pytest.mark.parametrize(("mean_m_s", "w20_m_s"), [((4.0, -3.0), 8.0), ((0.0, 0.0), 5.0), ((6.0, 0.0), 0.0)])
def test_gusts_are_what_they_were_before(mean_m_s: tuple[float, float], w20_m_s: float) -> None:
    wind = Wind(np.random.default_rng(3), 5, mean_m_s=mean_m_s, w20_m_s=w20_m_s)
    above_m, velocity = np.array([1.0, 8, 30, 120, 500]), np.linspace(-12, 12, 15).reshape(5, 3)
    kept(f"gusts, {mean_m_s}, {w20_m_s}", [wind.advance(0.1, above_m, velocity).copy() for _ in range(40)])
