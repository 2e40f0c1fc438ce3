"""Fixtures shared by all tests."""

import gc
import os
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import Phase, settings
from kit import DEFAULT_EXAMPLES, MakeScenario

from fanet_mw.scenario import Scenario, config

pytest_plugins = ["fanet_mw.testing.plugin"]
"""The fixtures that we ship: found by itself only where the package is installed anew."""

settings.register_profile("default", deadline=None, max_examples=DEFAULT_EXAMPLES, derandomize=True)
"""The same examples in every run: what is refused is refused for everybody, and again after the same command. There is
no deadline, because first calls compile."""
settings.register_profile("explore", deadline=None, max_examples=300)
"""New examples in each run, and more of them: for `scripts/test --all`."""
settings.load_profile("default")
settings.register_profile(
    "mutants", deadline=None, max_examples=DEFAULT_EXAMPLES, derandomize=True, database=None,
    phases=(Phase.explicit, Phase.generate),
)  # fmt: skip
"""For `scripts/mutants`: as many as in a default run, and none made smaller: that a test fails is enough."""

settings.register_profile("fast", deadline=None, max_examples=5, derandomize=True)
"""For `scripts/test --fast`."""

_FAST = ("unit/", "property/")
_NOT_FAST = (
    "unit/cli/",
    "unit/figures/",
    "unit/project/",
    "unit/world/",
    "unit/sweep/",
    "unit/run/",
    "unit/inspection/",
    "unit/planner/",
    "unit/results/test_run_folder.py",
    "unit/results/test_results.py",
    "unit/emulator/test_fading.py",
    "unit/emulator/test_losses_and_levels.py",
    "property/test_ground.py",
    "property/test_planner.py",
)
"""Folders below `tests/` of what `--fast` tries, and what it leaves out of them: processes, pictures, flights, samples
that have to be large.
"""

_REALTIME = (
    "test_realtime", "test_host_realtime", "test_hosts", "test_radios", "test_real_radio", "test_time_scale",
    "test_back_pressure", "test_air_control", "test_broken_runs",
)  # fmt: skip
"""Modules whose tests live in real time. They wait more than they work, so four of them go side by side; none of them
asks how late this machine is: frames are announced long ahead, and what ends soon by itself is waited for."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--fast", action="store_true", help="only what an inner loop needs")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out modules of which `-m` chooses no test, where it ends as in `scripts/test`: each of the processes there
    would take some seconds to read them all.
    """
    if config.getoption("--fast") and collection_path.suffix == ".py" and collection_path.name.startswith("test_"):
        name = collection_path.relative_to(Path(__file__).parent).as_posix()
        if not name.startswith(_FAST) or name.startswith(_NOT_FAST):
            return True
    chosen = str(config.getoption("markexpr"))
    if collection_path.suffix != ".py" or not chosen.endswith("realtime"):
        return None
    in_real_time = collection_path.stem.startswith(_REALTIME)
    return True if in_real_time == chosen.endswith("not realtime") else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.get_closest_marker("realtime"):  # in a module that is not read for `-m realtime` it would never run
            raise pytest.UsageError(f"{item.nodeid}: a module whose tests live in real time is named so, not marked")
        if item.path.stem.startswith(_REALTIME):
            item.add_marker(pytest.mark.realtime)


@pytest.hookimpl(tryfirst=True)
def pytest_collection() -> None:
    """What is collected stays: the garbage collector would examine it again and again."""
    gc.disable()


def pytest_collection_finish() -> None:
    """From the first test on nobody writes bytecode: a process that may write no more, or is killed while it writes,
    would leave truncated files to all others. What pytest makes of test files while it collects them is kept.

    The half million objects of five thousand tests are frozen: the garbage collector would examine them in vain.
    """
    gc.collect()
    gc.freeze()
    gc.enable()
    sys.dont_write_bytecode = True
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"


@pytest.fixture(scope="session")
def make_scenario() -> MakeScenario:
    """Build a scenario from dotted keys: `make_scenario(**{"nodes.count": 3})`. Small and quiet by default."""

    def make(**keys: Any) -> Scenario:
        tree: dict[str, Any] = {}
        defaults = {"clusters.count": 1, "nodes.telemetry_hz": 0, "duration_s": 10}
        for key, value in {**defaults, **keys}.items():
            *path, last = key.split(".")
            table = tree
            for part in path:
                table = table.setdefault(part, {})
            table[last] = value
        return config.build(tree)

    return make
