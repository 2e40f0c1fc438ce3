"""There is one ground: pads, roofs, rays, clearances, maps, pictures and every engine have the same."""

import math
from typing import Any

import numpy as np
import pybullet
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from kit import slow

from agents.mission.navigation.onboard_map import OnboardMap
from fanet_mw.scenario import Scenario
from sim.scenarios import catalog
from sim.world.arrays import Rows
from sim.world.engines.contacts import Contacts
from sim.world.engines.contract import Engine
from sim.world.engines.kinematic import Kinematic
from sim.world.engines.pybullet import Physics
from sim.world.engines.rotors.rigid_body import Rotors
from sim.world.engines.rotors.vehicle_types import IRIS
from sim.world.environment.layout import ON_GROUND_M, positions
from sim.world.environment.obstacles import Box, Hills, Obstacles, obstacles
from sim.world.environment.solids import Solids
from sim.world.mobility.guidance import Guidance

terrains = st.builds(
    lambda seed, side, cell_m, most: Hills(np.random.default_rng(seed).uniform(0, most, (side, side)), cell_m),
    st.integers(0, 2**32 - 1), st.integers(3, 12), st.sampled_from([7.0, 10.0, 26.3]),
    st.sampled_from([1.0, 8.0, 40.0]),
)  # fmt: skip
quick = settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])


def places_on(hills: Hills, seed: int, count: int, *, beyond_m: float = 40.0) -> Rows:
    half = hills.cell_m * (hills.heights.shape[0] - 1) / 2 + beyond_m
    return np.random.default_rng(seed).uniform([-half, -half, 0], [half, half, 1], (count, 3))


@quick
@given(terrains, st.integers(0, 99))
def test_rays_maps_and_the_mesh_meet_the_ground_where_it_is(hills: Hills, seed: int) -> None:
    solid = Obstacles(hills, ())
    solids, engine = Solids(solid), Physics(physics_hz=240, obstacles=solid)
    engine.reset(np.array([[0.0, 0, 500]]))
    at = places_on(hills, seed, 60)
    ground = solids.ground_m(at)
    top = at * [1, 1, 0] + [0, 0, 60]
    down = solids.first_hit_m(top, np.tile([0.0, 0, -1], (len(at), 1)), 100.0)
    assert 60 - down == pytest.approx(ground, abs=1e-6)
    hits = pybullet.rayTestBatch(top.tolist(), (at * [1, 1, 0] - [0, 0, 1]).tolist(), physicsClientId=engine._client)
    assert [hit[3][2] for hit in hits] == pytest.approx(ground.tolist(), abs=0.05)  # its floats are short
    carried = OnboardMap((), tuple(map(tuple, hills.heights.tolist())), hills.cell_m)
    assert [carried.ground_m(east, north) for east, north, _ in at.tolist()] == pytest.approx(ground.tolist(), abs=1e-6)
    engine.close()


@quick
@given(terrains)
def test_the_mesh_covers_everything_once_and_faces_up(hills: Hills) -> None:
    corners, triangles = hills.mesh()
    assert set(triangles.ravel().tolist()) == set(range(len(corners)))
    a, b, c = (corners[triangles[:, n]] for n in range(3))
    up = np.cross(b - a, c - a)[:, 2] / 2
    assert (up > 0).all()
    east_m, north_m = np.ptp(corners[:, 0]), np.ptp(corners[:, 1])
    assert up.sum() == pytest.approx(east_m * north_m, rel=1e-9)
    assert min(east_m, north_m) > 2000, "and goes on beyond the map"


@quick
@given(terrains, st.integers(0, 99))
def test_a_slanting_ray_is_blocked_where_a_fine_scan_of_it_is_below_the_ground(hills: Hills, seed: int) -> None:
    solids = Solids(Obstacles(hills, ()))
    first, second = places_on(hills, seed, 40), places_on(hills, seed + 100, 40)
    for ends in (first, second):
        ends[:, 2] = solids.ground_m(ends) + 20 * ends[:, 2]
    share = np.linspace(0, 1, 4001)
    scan = first[:, None] + (second - first)[:, None] * share[:, None]
    above = scan[..., 2] - solids.ground_m(scan.reshape(-1, 3)).reshape(scan.shape[:2])
    least = above.min(axis=1)
    clear = np.abs(least) > 0.05
    assert (solids.blocked(first, second)[clear] == (least < 0)[clear]).all()
    assert solids.least_gap_m(first, second, within_m=math.inf) == pytest.approx(least, abs=0.2)


def engine_of(name: str, solid: Obstacles) -> Engine:
    if name == "pybullet":
        return Physics(physics_hz=240, obstacles=solid)
    return Kinematic(Solids(solid)) if name == "kinematic" else Rotors(IRIS, solids=Solids(solid))


@pytest.mark.parametrize("name", ["kinematic", "pybullet", *slow("rotors")])
@pytest.mark.parametrize("terrain_m", [40, *slow(15)])
def test_uavs_land_on_hills_and_beyond_them_and_their_motors_stop(name: str, terrain_m: float) -> None:
    keys = [f"world.terrain_m={terrain_m}", "world.area_m=400", "world.terrain_scale_m=120", "nodes.count=9",
            "nodes.on_ground=true", "nodes.spacing_m=190", 'mobility.model="onboard"']  # fmt: skip
    scenario = catalog.find("quick", keys)
    starts = np.array(positions(scenario))
    starts[-1, :2] = 240, 230  # beyond the map, where its edge continues
    solid = obstacles(
        catalog.find("quick", [*keys, "nodes.on_ground=false", "nodes.altitude_m=90"]), starts + np.array([0, 0, 90])
    )
    solids = Solids(solid)
    starts[:, 2] = solids.ground_m(starts) + ON_GROUND_M
    landed = flown_down(scenario, engine_of(name, solid), starts + np.array([0, 0, 2]), solids)
    assert landed.all(), "all of them have noticed that they stand on the ground"


@pytest.mark.parametrize("name", ["kinematic", *slow("rotors", "pybullet")])
def test_a_uav_that_lands_on_a_roof_stops_its_motors(name: str) -> None:
    solid = Obstacles(None, (Box(0, 0, 20, 20, 12, 0.3),))
    scenario = catalog.find("quick", ["nodes.count=3", 'mobility.model="onboard"'])
    engine = engine_of(name, solid)
    assert flown_down(scenario, engine, np.array([[3.0, 2, 15], [-5, 1, 16], [2, 20, 3]]), Solids(solid)).all()


def flown_down(scenario: Scenario, engine: Engine, starts: Rows, solids: Solids) -> Any:
    """Land all UAVs, which are in the air; returns which stand on the ground after 12 s."""
    engine.reset(starts)
    guidance = Guidance(starts, scenario, surface_m=solids.surface_m)
    for node in range(1, len(starts) + 1):
        guidance.land_at_once(node)
    for step in range(240):
        engine.stand(guidance.grounded(engine.positions()))
        engine.advance(0.05, guidance.wanted(step * 0.05, engine.positions()))
    found = guidance.grounded(engine.positions())
    high = engine.positions()[:, 2] - solids.surface_m(engine.positions())
    assert (high > -0.01).all()
    engine.close()
    return found


@pytest.mark.parametrize("terrain_m", [15, 40])
def test_pads_and_roofs_stand_on_the_ground(terrain_m: float) -> None:
    keys = [f"world.terrain_m={terrain_m}", "world.buildings=12", "nodes.on_ground=true", "world.area_m=900"]
    scenario = catalog.find("rescue-base", keys)
    starts = np.array(positions(scenario))
    solid = obstacles(scenario, starts)
    solids = Solids(solid)
    *pads, post = (starts[:, 2] - solids.ground_m(starts)).tolist()
    assert pads == pytest.approx([ON_GROUND_M] * 45)
    assert post == pytest.approx(scenario.ground.antenna_m)
    middles = np.array([[box.east, box.north, 0] for box in solid.boxes])
    heights = np.array([box.roof for box in solid.boxes]) - solids.ground_m(middles)
    least, greatest = scenario.world.building_height_m
    assert ((heights >= least - 1e-9) & (heights <= greatest + 1e-9)).all()


def test_paths_beside_slopes_touch_them_as_far_as_the_blades_reach() -> None:
    """At least 0.999 of true contacts, by the distance in any direction, are seen: drawn paths near drawn hillsides."""
    reach_m, generator = IRIS.reach_m, np.random.default_rng(3)
    axis = np.linspace(-reach_m, reach_m, 31)
    ball = np.array([(x, y) for x in axis for y in axis if math.hypot(x, y) <= reach_m])
    ball = np.column_stack([ball, -np.sqrt(reach_m**2 - (ball**2).sum(axis=1))])
    true = seen = 0
    for cell_m, most_m in ((7.0, 3.0), (10.0, 15.0), (26.3, 40.0), (7.0, 40.0)):
        solids = Solids(Obstacles(Hills(generator.uniform(0, most_m, (8, 8)), cell_m), ()))
        start = generator.uniform(-3.5 * cell_m, 3.5 * cell_m, (300, 3))
        start[:, 2] = solids.ground_m(start) + generator.uniform(0.2, 3.0, 300)
        way = generator.normal(size=(300, 3)) * [1, 1, 0.4]
        way *= (generator.uniform(2, 30, 300) * 0.05 / np.linalg.norm(way, axis=1))[:, None]
        contacts = Contacts(reach_m, solids)
        contacts.notice(start, start + way)
        noticed = {second - 1 for first, second in contacts.take() if first == 0}
        touched = np.zeros(300, bool)
        for share in np.linspace(0, 1, 7):
            low = ((start + share * way)[:, None] + ball).reshape(-1, 3)
            touched |= (low[:, 2] <= solids.ground_m(low)).reshape(300, -1).any(axis=1)
        true += int(touched.sum())
        seen += len(noticed & {*np.flatnonzero(touched).tolist()})
        assert len(noticed) <= touched.sum() + 3, "and hardly anything else is"
    assert true > 200
    assert seen >= 0.999 * true
