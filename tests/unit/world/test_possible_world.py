"""A world that no run could build is refused by `fanet check`, by a sweep's plan and by the launcher, as by a run."""

import asyncio
import json
from pathlib import Path

import pytest

from fanet_mw.errors import ConfigError
from sim.cli.app import app
from sim.cli.sweep import asked
from sim.run.launcher.swarm import launch
from sim.scenarios import catalog
from sim.sweep import spec
from sim.sweep.tasks import tasks_of
from sim.world.environment import obstacles

IMPOSSIBLE = [
    ('world.heightmap="nope.asc"', r"world.heightmap: .*nope.asc: cannot be read"),
    ('world.heightmap="small.asc"', r"covers 2 m to the east, which must be >= world.area_m = 800"),
    ('world.buildings_geojson="none.json"', r"none.json is no GeoJSON of buildings: it holds no Polygon"),
    ("world.no_fly_m=[[0,0,50]]", r"world.no_fly_m.0: node 1 starts within it"),
    ("world.buildings=[[0,0,300,300,200]]", r"node 1 starts within the building at \[0, 0\]"),
    ("world.buildings=[[500,500,9,9,9],[20,0,9,9,60]]", r"node 6 starts within the building at \[20, 0\]"),
    ("world.base_m=[100000,0]", r"world.base_m = \[100000, 0\] must be within \+-2 x world.area_m = 1600"),
]


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.asc").write_text("ncols 2\nnrows 2\ncellsize 1\n1 2\n3 4\n")
    (tmp_path / "none.json").write_text(json.dumps({"type": "FeatureCollection", "features": []}))
    scenario = tmp_path / "m.toml"
    scenario.write_text("[world]\narea_m = 800\n[nodes]\ncount = 9\nspacing_m = 20\n")
    return str(scenario)


@pytest.mark.parametrize(("change", "why"), IMPOSSIBLE, ids=[change for change, _ in IMPOSSIBLE])
def test_an_impossible_world_is_refused_before_any_run(file: str, change: str, why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        app(["check", file, "--set", change], result_action="return_value")
    with pytest.raises(ConfigError, match=why):
        tasks_of(asked(file, (change,), 1, None)[1])


def test_the_launcher_starts_no_process_of_an_impossible_world(file: str) -> None:
    with pytest.raises(ConfigError, match="node 1 starts within it"):
        asyncio.run(launch(catalog.find(file, ["world.no_fly_m=[[0,0,50]]"]), swarm="impossible"))


def test_a_sweep_names_each_impossible_world_once_with_the_case_that_has_it() -> None:
    sweep = spec.parse('base = "quick"\nseeds = 3\n[grid]\n"world.no_fly_m" = [[], [[0, 0, 400]]]\n', source="test")
    with pytest.raises(ConfigError, match="node 1 starts within it") as refused:
        tasks_of(sweep)
    assert str(refused.value).count("starts within") == 1
    assert "world.no_fly_m=[[0, 0, 400]]" in str(refused.value)


@pytest.mark.parametrize(
    ("world", "worlds"),
    [
        ("", 0),
        ("world.buildings = [[300, 300, 20, 20, 9]]", 2),
        ("world.buildings = 2", 2 * 5),
        ('world.buildings = [[300, 300, 20, 20, 9]]\nnodes.layout = "disc"', 2 * 5),
    ],
    ids=["nothing in it", "the same for all seeds", "drawn by the seed", "starts drawn by the seed"],
)
def test_each_world_of_a_sweep_is_built_once(monkeypatch: pytest.MonkeyPatch, world: str, worlds: int) -> None:
    built = []
    whole = obstacles.obstacles
    monkeypatch.setattr(obstacles, "obstacles", lambda *given: built.append(given) or whole(*given))
    text = f'base = "quick"\nseeds = 5\n[set]\n{world}\n[grid]\n"nodes.count" = [3, 4]\n"traffic.interval_s" = [1, 2]\n'
    assert len(tasks_of(spec.parse(text, source="test"))) == 20
    assert len(built) == worlds
