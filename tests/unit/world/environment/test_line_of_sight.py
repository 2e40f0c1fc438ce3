"""What stands in the way: buildings and hills, the pairs they part, and what the medium makes of it."""

from array import array
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from fanet_mw.bus.messages import Obstructions, Poses
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, S
from sim.world.engines.pybullet import Physics
from sim.world.environment.layout import positions
from sim.world.environment.line_of_sight import Sight
from sim.world.environment.obstacles import Box, Obstacles, obstacles
from sim.world.environment.solids import Solids
from sim.world.world import WorldActor
from tests.unit.emulator.hand_driven import NAMES, Air, receptions

MakeScenario = Callable[..., Scenario]
TOWER = Box(0, 0, 20, 40, 60)
TOWN = Obstacles(hills=None, boxes=(TOWER, Box(200, 0, 10, 10, 10)))
PYBULLET = {"world.engine": "pybullet", "nodes.layout": "explicit"}


@pytest.fixture
def town() -> Iterator[Physics]:
    made = Physics(physics_hz=240, obstacles=TOWN)
    made.reset(np.array([[-50.0, 0, 50], [0, 0, 80]]))
    yield made
    made.close()


@pytest.mark.parametrize(
    ("first", "second", "blocked"),
    [
        ((-50, 0, 50), (50, 0, 50), True),
        ((50, 0, 50), (-50, 0, 50), True),
        ((-50, 0, 61), (50, 0, 61), False),  # over the roof
        ((-50, 21, 50), (50, 21, 50), False),  # past the wall
        ((-50, 19, 50), (50, 19, 50), True),
        ((-50, 0, 100), (50, 0, 30), True),  # 72 m high above the near wall, 58 m above the far one
        ((-50, 0, 1), (-50, 0, 90), False),
        ((0, 0, 70), (0, 0, 90), False),  # the UAV between them, at 80 m, is none
        ((190, 0, 5), (210, 0, 5), True),
    ],
)
def test_a_building_hides_what_is_behind_it_and_nothing_else(
    first: tuple[float, ...], second: tuple[float, ...], blocked: bool
) -> None:
    assert Solids(TOWN).blocked(np.array([first], float), np.array([second], float)).tolist() == [blocked]


def test_a_pair_is_asked_for_if_one_of_them_is_below_the_highest_obstacle(make_scenario: MakeScenario) -> None:
    """Node 1 is low; node 2, above every roof, is hidden from it by the tower; node 3, as high, sees node 2."""
    sight = Sight(make_scenario(**{"nodes.count": 3}), Solids(TOWN))
    at = np.array([[50.0, 0, 30], [-50, 0, 100], [-60, 0, 100]])
    assert sight.obstructions(at, 0).pairs.tolist() == [1, 2, 1, 3]


def test_a_uav_that_flies_into_a_building_is_stopped_and_noticed(town: Physics) -> None:
    for _ in range(160):
        town.advance(0.05, np.array([[10.0, 0, 0], [0, 0, 0]]))
    assert town.contacts() == [(0, 1)]
    assert town.positions()[0, 0] < -10 + 0.3, "the wall is at -10 m"


def test_hills_rise_to_their_height_and_hide(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(
        **{"world.engine": "pybullet", "world.terrain_m": 40, "nodes.count": 2, "nodes.altitude_m": 60}
    )
    starts = np.array(positions(scenario))
    solid = obstacles(scenario, starts)
    assert solid.hills is not None
    heights = solid.hills.heights
    assert heights.min() == 0
    assert heights.max() == solid.top_m == 40
    solids = Solids(solid)
    side = heights.shape[0]
    row, column = np.unravel_index(int(heights[2:-2, 2:-2].argmax()), (side - 4, side - 4))
    peak = [(i + 2 - (side - 1) / 2) * solid.hills.cell_m for i in (column, row)]
    west, east = [peak[0] - 100, peak[1], 36], [peak[0] + 100, peak[1], 36]
    above = [[x, y, 41] for x, y, _ in (west, east)]
    assert solids.blocked(np.array([west, above[0]]), np.array([east, above[1]])).tolist() == [True, False]
    height = heights[row + 2, column + 2]
    low = [[*peak, height + 0.5], [*peak, height - 0.5]]
    down = solids.blocked(np.array([[*peak, height + 1]] * 2), np.array(low))
    assert down.tolist() == [False, True], "the ground of the rays is that of the heights"


def test_seeded_buildings_are_those_of_the_seed_and_clear_of_every_start(make_scenario: MakeScenario) -> None:
    keys = {"world.engine": "pybullet", "world.buildings": 60, "nodes.count": 25, "nodes.altitude_m": 12}
    sizes = {"world.building_size_m": (20, 50), "world.building_height_m": (10, 30), "world.area_m": 800}
    scenario = make_scenario(**keys, **sizes)
    starts = np.array(positions(scenario))
    solid = obstacles(scenario, starts)
    assert solid == obstacles(scenario, starts)
    assert solid != obstacles(make_scenario(**keys, **sizes, seed=2), starts)
    assert len(solid.boxes) == 60
    assert not any(box.near(starts, margin_m=4.9) for box in solid.boxes)
    assert all(10 <= box.roof <= 30 and 20 <= box.width <= 50 and 20 <= box.depth <= 50 for box in solid.boxes)


@pytest.mark.parametrize(
    ("keys", "named"),
    [
        ({"world.buildings": 3, "world.buildings_geojson": "town.geojson"}, "exclude each other"),
        ({"world.terrain_m": 3, "world.heightmap": "hills.asc"}, "exclude each other"),
        ({"world.engine": "pybullet", "world.building_size_m": (9, 3)}, r"must be \[least, greatest\]"),
    ],
)
def test_keys_that_do_not_fit_are_refused(make_scenario: MakeScenario, keys: dict[str, Any], named: str) -> None:
    with pytest.raises(ConfigError, match=named):
        make_scenario(**keys)


def test_a_start_within_an_obstacle_is_refused(make_scenario: MakeScenario) -> None:
    building = make_scenario(**{"world.engine": "pybullet", "world.buildings": ((0, 0, 900, 900, 60),)})
    hill = make_scenario(**{"world.engine": "pybullet", "world.terrain_m": 900, "nodes.altitude_m": 0.1})
    for scenario in (building, hill):
        with pytest.raises(ConfigError, match="start"):
            obstacles(scenario, np.array(positions(scenario)))


def parted(make_scenario: MakeScenario, **keys: Any) -> tuple[Scenario, WorldActor]:
    """Nodes 1 and 3 on either side of a tower, node 2 above its roof."""
    scenario = make_scenario(
        **PYBULLET,
        **{
            "nodes.count": 3,
            "nodes.positions_m": ((-60, 0, 30), (0, 0, 70), (60, 0, 30)),
            "world.buildings": ((0, 0, 20, 20, 50),),
            **keys,
        },
    )
    return scenario, WorldActor(scenario, "test")


def test_the_world_tells_who_is_parted_before_it_tells_the_poses(make_scenario: MakeScenario) -> None:
    _, world = parted(make_scenario)
    world.start(0)
    kinds = [type(message) for _, message in world.outbox]
    assert kinds.index(Obstructions) < kinds.index(Poses)
    (told,) = [message for topic, message in world.outbox if topic == NAMES.obstruction]
    assert told == Obstructions(0, array("H", [1, 3]))
    world.stop(0)


def test_beyond_the_reach_of_the_radio_nobody_asks(make_scenario: MakeScenario) -> None:
    _, world = parted(make_scenario, **{"radio.range_m": 100})
    world.start(0)
    (told,) = [message for topic, message in world.outbox if topic == NAMES.obstruction]
    assert told == Obstructions(0, array("H"))
    world.stop(0)


@pytest.mark.parametrize(("loss_db", "heard"), [(60, [2]), (3, [2, 3])])
def test_the_medium_takes_the_loss_off_the_links_that_are_parted(
    make_scenario: MakeScenario, loss_db: float, heard: list[int]
) -> None:
    scenario, world = parted(make_scenario, **{"radio.channel": "friis", "radio.obstruction_loss_db": loss_db})
    world.start(0)
    air = Air(scenario, [0, 0, 0])
    for topic, message in world.outbox:
        if isinstance(message, Obstructions | Poses):
            air.medium.receive(topic, message, 0)
    air.send(1, 1 * MS)
    assert sorted(node for node, _, _ in receptions(air.run())) == heard
    world.stop(0)


def test_in_a_still_world_an_obstruction_that_comes_late_counts_from_the_next_poses_on(
    make_scenario: MakeScenario,
) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    air.medium.receive(NAMES.obstruction, Obstructions(0, array("H", [1, 2])), 0)
    air.send(1, 1 * MS)
    air.medium.wake(10 * MS)
    air.place([0, 100], S)
    air.send(1, S + MS, now_ns=S)
    assert len(receptions(air.run(2 * S))) == 1, "the first, not the second"


def test_hostile_obstructions_are_counted_and_change_nothing(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    for pairs in ([1], [1, 3], [0, 1], [1, 2, 2]):
        air.medium.receive(NAMES.obstruction, Obstructions(0, array("H", pairs)), 0)
    air.place([0, 101], 0)
    air.send(1, 1 * MS)
    assert len(receptions(air.run())) == 1
    assert air.medium.report()["refused"] == {"obstructions": 4}


def test_who_starts_below_the_ground_is_named(make_scenario: MakeScenario) -> None:
    keys = {"world.engine": "pybullet", "world.terrain_m": 100, "nodes.count": 3, "nodes.layout": "explicit"}
    low = make_scenario(**keys, **{"nodes.positions_m": [[0, 0, 200], [10, 0, 0.001], [20, 0, 200]], "seed": 2})
    with pytest.raises(ConfigError, match=r"node 2 starts at 0\.001 m, below the ground there"):
        obstacles(low, np.array(positions(low)))
