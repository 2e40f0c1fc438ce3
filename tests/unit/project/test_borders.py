"""The borders between folders: no circles, layers that a planted import breaks, and results that need no bus."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PRODUCT = ("fanet_mw", "agents", "emulator", "sim")
PLANTED = {
    "fanet_mw/routing/clustered/roles/failure_detectors.py": "import fanet_mw.routing.clustered.timetable.turn_size",
    "sim/results/coherence.py": "import sim.run.virtual",
    "sim/world/engines/contacts.py": "import sim.world.sensors.radar",
    "emulator/kernel/heap.py": "import emulator.channel.fading",
}
WITHOUT_ZENOH = """
import sys
class Zenoh:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "zenoh":
            raise ImportError("no zenoh here")
sys.meta_path.insert(0, Zenoh())
import importlib, pkgutil
import sim.results
for found in pkgutil.iter_modules(sim.results.__path__):
    importlib.import_module(f"sim.results.{found.name}")
from fanet_mw.__main__ import main
sys.argv = ["fanet", "simulate", "quick", "--set", "duration_s=1", "warmup_s=0", "drain_s=0", "faults=[]"]
main()
"""


def test_no_folder_is_in_a_circle_of_imports() -> None:
    spec = importlib.util.spec_from_file_location("census", ROOT / "scripts" / "census.py")
    assert spec is not None
    assert spec.loader is not None
    census = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(census)
    paths = [path for folder in PRODUCT for path in census.python_files(ROOT, folder)]
    assert census.circles(census.imports(ROOT, paths)) == []
    assert census.circles({"a.x.m": {"a.y"}, "a.y": {"a.x.n"}, "a.x.n": set()}) == ["a: x y"]


def test_an_import_against_the_layers_breaks_each_of_them(tmp_path: Path) -> None:
    for folder in PRODUCT:
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for path, line in PLANTED.items():
        file = tmp_path / path
        file.write_text(f"{file.read_text()}\n{line}\n")
    done = subprocess.run(
        [Path(sys.executable).parent / "lint-imports", "--no-cache"],
        cwd=tmp_path, capture_output=True, text=True, check=False, env={"PYTHONPATH": str(tmp_path), "COLUMNS": "200"},
    )  # fmt: skip
    broken = [line.partition(":")[0] for line in done.stdout.splitlines() if line.endswith("BROKEN")]
    assert broken == ["clustered", "sim", "sim.world", "emulator"]


@pytest.mark.timeout(60)
def test_results_and_runs_in_virtual_time_need_no_zenoh(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_ZENOH], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "9 nodes, seed 1, virtual time" in done.stdout
