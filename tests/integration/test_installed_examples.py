"""The examples as a user runs them: from installed wheels, in an empty folder, with public names alone."""

import ast
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from installed import EXAMPLES, ROOT, Installed

import fanet_mw

TEST = ("-m", "pytest", "-q", "-p", "no:cacheprovider")


def test_what_runs_is_what_the_wheels_hold(installed: Installed, tmp_path: Path) -> None:
    """Else the other tests here would show nothing: the checkout is importable in the environment of the tests."""
    say = "import fanet_mw, agents, sim, swarm_parts as s; print(*(m.__file__ for m in (fanet_mw, agents, sim, s)))"
    ended = installed.run(installed.python, "-c", say, cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert all(Path(name).is_relative_to(installed.folder) for name in ended.stdout.split()), ended.stdout
    assert fanet_mw.__version__ in installed.run(installed.fanet, "--version", cwd=tmp_path).stdout


def test_the_test_of_fifteen_lines_passes_and_finds_the_fixture_by_itself(installed: Installed, tmp_path: Path) -> None:
    shutil.copy(EXAMPLES / "my-message" / "test_greeting.py", tmp_path)
    ended = installed.run(installed.python, *TEST, cwd=tmp_path)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "1 passed" in ended.stdout


@pytest.mark.parametrize(
    ("chosen", "passed"),
    [("json or past or (once and one and not moving)", 2), pytest.param("", 16, marks=pytest.mark.slow)],
)
def test_a_protocol_of_another_package_keeps_the_contract(
    installed: Installed, tmp_path: Path, chosen: str, passed: int
) -> None:
    shutil.copy(EXAMPLES / "swarm-parts" / "tests" / "test_gossip3.py", tmp_path)
    ended = installed.run(installed.python, *TEST, "-k", chosen, "test_gossip3.py::TestGossip3", cwd=tmp_path)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert f"{passed} passed" in ended.stdout


@pytest.mark.parametrize("folder", ["my-message", "swarm-parts"])
def test_in_a_clone_an_example_is_tested_by_pytest_alone(folder: str) -> None:
    """Without the plugins that the strict configuration of this project's own tests names."""
    without = [word for plugin in ("asyncio", "timeout") for word in ("-p", f"no:{plugin}")]
    words = [sys.executable, *TEST, "--collect-only", *without, f"examples/{folder}"]
    ended = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr


def _modules(tree: ast.AST) -> set[str]:
    """The modules of ours from which something is imported; what is private among the names is an error."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            assert not [alias.name for alias in node.names if alias.name.startswith("_")]
            found.add(node.module or "")
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {module for module in found if module.partition(".")[0] in ("fanet_mw", "agents", "emulator", "sim")}


def _documented() -> set[str]:
    """The modules that the page about parts of one's own names."""
    page = (ROOT / "docs" / "how-to" / "extend.md").read_text(encoding="utf-8")
    names = re.findall(r"`((?:fanet_mw|sim|emulator)[./][\w./]+)`", page)
    return {name.removesuffix(".py").replace("/", ".") for name in names}


@pytest.mark.parametrize("path", sorted(EXAMPLES.rglob("*.py")), ids=lambda path: path.name)
def test_an_example_uses_public_names_only(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    documented = _documented()
    assert "fanet_mw.node.contract" in documented, "else the page is no longer understood here"
    for module in _modules(tree) - {"fanet_mw"}:
        assert any(module == name or module.startswith(f"{name}.") for name in documented), module
    for node in ast.walk(tree):
        if not isinstance(node, ast.Attribute):
            continue
        owner = node.value.id if isinstance(node.value, ast.Name) else ""
        assert owner == "self" or not re.match("_(?!_)", node.attr), node.attr
        assert owner != "fanet_mw" or node.attr in fanet_mw.__all__


@pytest.mark.parametrize("name", ["node.py", "test_greeting.py"])
def test_the_node_and_the_test_have_fifteen_lines_and_import_the_package_alone(name: str) -> None:
    text = (EXAMPLES / "my-message" / name).read_text(encoding="utf-8")
    assert _modules(ast.parse(text)) <= {"fanet_mw"}
    assert len([line for line in text.splitlines() if line.strip() and not line.startswith('"""')]) <= 15
