"""A package of a user's with the name of one of ours is named as the reason; no test is skipped for it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def run(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *command], cwd=folder, capture_output=True, text=True, timeout=100, check=False,
        env={**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}"},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("package", "kind"),
    [
        ("emulator", "module"),
        ("agents", "package"), ("sim", "folder"),
            ("agents", "folder"), ("agents", "module"), ("sim", "package"), ("sim", "module"), ("emulator", "package"),
            ("emulator", "folder"),
    ],
)  # fmt: skip
@pytest.mark.slow
def test_a_package_of_ones_own_with_our_name_fails_the_tests_that_ask_for_a_swarm(
    tmp_path: Path, package: str, kind: str
) -> None:
    if kind == "module":
        (tmp_path / f"{package}.py").write_text("")
    else:
        (tmp_path / package).mkdir()
        (tmp_path / package / ("mine.py" if kind == "folder" else "__init__.py")).write_text("")
    (tmp_path / "test_mine.py").write_text("def test_mine(swarm):\n    pass\n\ndef test_real(real_swarm):\n    pass\n")
    ended = run(tmp_path, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_mine.py")
    if kind == "folder" and "2 passed" in ended.stdout:
        return  # a folder without __init__.py does not stand in the way of a package
    assert ended.returncode == 1, ended.stdout + ended.stderr
    assert "2 errors" in ended.stdout or "2 failed" in ended.stdout, ended.stdout
    assert f"is not the package '{package}' of fanet-mw, and comes before it on sys.path" in ended.stdout


def test_a_name_that_another_package_hides_says_so_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "agents").mkdir()
    (tmp_path / "agents" / "__init__.py").write_text("")
    ended = run(tmp_path, "-c", "import fanet_mw\ntry: fanet_mw.join\nexcept ImportError as error: print(error)")
    assert ended.stdout.startswith(f"fanet_mw.join: {tmp_path / 'agents'} is not the package 'agents' of fanet-mw")
