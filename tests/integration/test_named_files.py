"""Runs are told apart by the contents of what their scenarios name: maps, and modules of others. Where these lie
does not matter, and a result folder goes anywhere whole.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.results import read
from fanet_mw.scenario import config
from fanet_mw.scenario.fingerprint import as_json, differences, fingerprint
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.sweep import one_run, spec
from sim.sweep.tasks import tasks_of

SCENARIO = """duration_s = 3
[nodes]
count = 3
layout = "line"
spacing_m = 200
altitude_m = 20
[routing]
protocol = "flooding"
[world]
area_m = 2500
buildings_geojson = "town.geojson"
origin_deg = [48.8566, 2.3522]
"""
PLUG_IN = """from helper import COUNT
from fanet_mw.application import Application, Data
class Talk(Application):
    name = "talk"
    def __init__(self, scenario, node, options): pass
    def start(self, port, now_ns):
        super().start(port, now_ns)
        for _ in range(COUNT):
            port.send(Data(5, bytes(100)))
"""


def town(folder: Path, *, height: float) -> Path:
    """Towers between the nodes, or sheds."""
    ring = [(-0.05, 0.0), (0.05, 0.0), (0.05, -0.9), (-0.05, -0.9), (-0.05, 0.0)]
    features = [
        {
            "type": "Feature", "properties": {"height": height},
            "geometry": {
                "type": "Polygon",
                "coordinates": [[[2.3522 + middle + x * 1e-3, 48.8566 + 4e-4 + y * 1e-3] for x, y in ring]],
            },
        }
        for middle in (-1.36e-3, 1.36e-3)
    ]  # fmt: skip
    folder.mkdir(exist_ok=True)
    (folder / "town.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    (folder / "place.toml").write_text(SCENARIO)
    return folder / "place.toml"


def test_a_map_in_another_folder_makes_the_same_scenario_and_another_map_another_one(tmp_path: Path) -> None:
    here, there = (config.load(town(tmp_path / name, height=60)) for name in ("a", "b"))
    other = config.load(town(tmp_path / "c", height=5))
    assert fingerprint(here) == fingerprint(there) != fingerprint(other)
    (key, _, _), *_ = differences(json.loads(as_json(here)), json.loads(as_json(other)))
    assert key == "world.buildings_sha256"
    assert str(tmp_path) not in as_json(here)


def test_a_run_with_another_map_of_the_same_name_is_another_run(tmp_path: Path) -> None:
    def task() -> one_run.Task:
        sweep = spec.Sweep(base=str(tmp_path / "s" / "place.toml"))
        return tasks_of(sweep)[0]

    town(tmp_path / "s", height=5)
    sheds = task()
    town(tmp_path / "s", height=60)
    towers = task()
    assert sheds.key != towers.key
    assert "has the digest" in str(one_run.carry_out(sheds).error), "what was planned is not there any more"
    town(tmp_path / "s", height=5)
    assert task().key == sheds.key
    assert one_run.carry_out(sheds).error is None


def test_a_result_folder_runs_again_after_it_was_moved_and_its_map_is_gone(tmp_path: Path) -> None:
    first = finish(simulate(config.load(town(tmp_path / "a", height=60))), out=tmp_path / "out")
    shutil.rmtree(tmp_path / "a")
    (tmp_path / "else where").mkdir()
    moved = (tmp_path / "out").rename(tmp_path / "else where" / "käse")
    text = (moved / "scenario.toml").read_text()
    assert 'buildings_geojson = "town.geojson"' in text
    assert str(tmp_path) not in text
    again = finish(simulate(config.load(moved / "scenario.toml")), out=moved)
    assert again["trace_sha256"] == first["trace_sha256"]
    (moved / "town.geojson").write_bytes((moved / "town.geojson").read_bytes() + b" ")
    with pytest.raises(ConfigError, match=r"town.geojson: the file has the digest \w{16}, and world.buildings_sha256"):
        config.load(moved / "scenario.toml")


@pytest.mark.slow
def test_a_sweep_runs_again_what_ran_with_another_plug_in_or_another_helper_of_it(tmp_path: Path) -> None:
    (tmp_path / "talk.py").write_text(PLUG_IN)
    (tmp_path / "s.toml").write_text(
        SCENARIO.split("[world]")[0] + '[traffic]\narrivals = "none"\n[[applications]]\nuse = "talk:Talk"\n'
    )

    def sent() -> int:
        subprocess.run(
            [sys.executable, "-m", "fanet_mw", "sweep", "s.toml", "--out", "out"],
            env={**os.environ, "PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1", "FANET_NO_NUMBA": "1"},
            cwd=tmp_path, check=True, capture_output=True, timeout=100,
        )  # fmt: skip
        (summary,) = read(tmp_path / "out")["summary"].to_pylist()
        return json.loads(summary)["applications"]["talk"]["generated"]

    for count in (1, 2):
        (tmp_path / "helper.py").write_text(f"COUNT = {count}\n")
        assert sent() == 3 * count
