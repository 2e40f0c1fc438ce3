"""The package as it is installed: whole or damaged, with and without its extras."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from kit import slow

from fanet_mw import installation
from fanet_mw.scenario import Scenario, config
from fanet_mw.scenario.fingerprint import fingerprint
from sim.cli.options import ScenarioFlags
from sim.run.arguments import scenario_of
from sim.scenarios import catalog
from sim.sweep.spec import Sweep
from sim.sweep.tasks import tasks_of

ROOT = Path(__file__).parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = ("numpy", "numba", "pybullet")
"""The modules that only extras bring."""
DEVELOPMENT = {"pytest", "mypy", "hypothesis", "ruff", "import-linter"}


def fanet(*arguments: str, path: tuple[Path, ...]) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (*path, ROOT)))}
    command = [sys.executable, "-m", "fanet_mw", *arguments]
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=60, check=False, cwd=path[0]
    )


@pytest.fixture
def core_only(tmp_path: Path) -> Path:
    """A folder that hides what extras bring from every interpreter that has it on its path."""
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\n"
        "class Hidden:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name.partition('.')[0] in {EXTRAS!r}:\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Hidden())\n"
    )
    return tmp_path


def test_this_installation_is_whole() -> None:
    assert installation.damage() is None


def test_a_distribution_that_overwrites_one_of_our_packages_is_named_at_start(tmp_path: Path) -> None:
    (tmp_path / "agents").mkdir()
    (tmp_path / "agents" / "__init__.py").write_text('"""Agents of somebody else."""\nraise RuntimeError("was run")\n')

    ended = fanet("--version", path=(tmp_path,))

    assert ended.returncode == 2
    assert f"{tmp_path / 'agents'} is not the package 'agents' of fanet-mw" in ended.stderr
    assert "has overwritten it" in ended.stderr
    assert "environment of its own" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_package_of_ours_that_is_gone_is_named(tmp_path: Path) -> None:
    for package in ("fanet_mw", "emulator", "sim"):
        (tmp_path / package).symlink_to(ROOT / package)
    ask = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); from fanet_mw.installation import damage; print(damage())"
    )
    # -S, -E: without the site packages and PYTHONPATH, and so without the installation that runs this test
    said = subprocess.run(
        [sys.executable, "-S", "-E", "-c", ask], capture_output=True, text=True, check=True, cwd=tmp_path
    )

    assert "the package 'agents' of fanet-mw is not there" in said.stdout


@pytest.mark.parametrize("arguments", [("scenarios",), *slow((("plan", "clusters"),))])
def test_a_command_that_needs_no_extra_runs_without_any(core_only: Path, arguments: tuple[str, ...]) -> None:
    ended = fanet(*arguments, path=(core_only,))

    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout


def test_a_command_that_needs_an_extra_says_which(core_only: Path) -> None:
    ended = fanet("simulate", "flooding", path=(core_only,))

    assert ended.returncode == 2
    assert ended.stderr == (
        "fanet: this command needs numpy, which is not installed: pip install 'fanet-mw[emulator]'\n"
    )


def test_a_public_name_that_needs_an_extra_says_which(core_only: Path) -> None:
    names = ("simulate", "launch", "VirtualSwarm")
    program = (
        "import fanet_mw; fanet_mw.join, fanet_mw.Application\n"
        f"for name in {names}:\n"
        "    try: getattr(fanet_mw, name)\n"
        "    except ModuleNotFoundError as error: print(error)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (core_only, ROOT)))}
    ended = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=60, check=False
    )

    assert ended.stdout.splitlines() == [
        f"fanet_mw.{name} needs numpy, which is not installed: pip install 'fanet-mw[emulator]'" for name in names
    ], ended.stderr


def test_where_pybullet_is_not_installed_kinematic_serves_for_all_and_one_sentence_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)  # an import of it fails
    catalog.say_engine.cache_clear()
    given = Scenario.model_validate({"world": {"engine": "pybullet"}, "duration_s": 1, "warmup_s": 0})
    (task, *_) = tasks_of(Sweep(base="quick"))
    found = {
        "a command": ScenarioFlags().scenario("quick"),
        "a service": ScenarioFlags().realtime_scenario("quick"),
        "simulate": scenario_of("quick"),
        "simulate of a built one": scenario_of(given),
        "a sweep": config.build(task.tree),
        "a scenario with obstacles": catalog.find("town"),
    }
    assert {who: scenario.world.engine for who, scenario in found.items()} == dict.fromkeys(found, "kinematic")
    assert len({fingerprint(found[who]) for who in ("a command", "simulate", "a sweep")}) == 1
    assert capsys.readouterr().err.splitlines() == [
        "pybullet is not installed (pip install 'fanet-mw[pybullet]'): world.engine = \"kinematic\" serves instead."
    ]


def test_where_pybullet_is_installed_it_serves() -> None:
    assert catalog.find("quick").world.engine == "pybullet"


def test_everything_together_asks_for_no_pybullet_where_there_is_no_wheel_of_it() -> None:
    """The marker stands on pybullet itself: one on a reference to an extra of ours is lost when the wheel is built."""
    asked = [line for line in PROJECT["optional-dependencies"]["all"] if "pybullet" in line]
    assert asked == ["pybullet>=3.2.7; python_version < '3.12'"]


def test_every_dependency_is_imported_by_us_and_none_is_for_development() -> None:
    imported = set()
    for package in ("fanet_mw", "agents", "emulator", "sim"):
        for path in (ROOT / package).rglob("*.py"):
            imported.update(re.findall(r"^\s*(?:import|from) (\w+)", path.read_text(), re.MULTILINE))
    extras = [line for lines in PROJECT["optional-dependencies"].values() for line in lines]
    wanted = {re.split(r"[\[<>=; ]", line)[0] for line in (*PROJECT["dependencies"], *extras)} - {"fanet-mw"}

    modules = {
        name: {"eclipse-zenoh": "zenoh", "mcap-protobuf-support": "mcap_protobuf"}.get(name, name.replace("-", "_"))
        for name in wanted
    }
    assert {name for name, module in modules.items() if module not in imported} == set()
    assert not wanted & DEVELOPMENT
