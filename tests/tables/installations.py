"""What works in a clean environment: the wheel with and without extras, on each Python that is there.

The Pythons are `python3.11`, `python3.12` and `python3.13` of the path, or those named in PYTHONS, separated by spaces.
pip may take wheels only, so that what needs a compiler fails instead of compiling.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from tests.tables.markdown import Rows

ROOT: Final = Path(__file__).parents[2]
VERSIONS: Final = ("3.11", "3.12", "3.13")
EXTRAS: Final = ("", "[emulator]", "[all]")
COMMANDS: Final = (
    ("scenarios",), ("init", "mine.toml"), ("show", "quick"), ("check", "mine.toml"), ("schema",), ("plan", "clusters"),
    ("keys", "quick", "--out", "keys"), ("agent", "--help"), ("router", "--help"), ("simulate", "quick"),
    ("launch", "quick", "--duration", "9"),
    ("simulate", "town", "--duration", "10", "--set", "warmup_s=2", "drain_s=2"),
)  # fmt: skip
"""What is tried in each; `quick` and `town` ask for pybullet, `town` has buildings besides."""
_FIRST: Final = "`simulate quick`, first time"
MACHINE: Final = ("Python", "packages", "MB", "`fanet --version`", _FIRST, "again")
"""The columns that depend on the machine and on what the registries offer today."""
_CRASHED: Final = -1
_SAYS_WHICH: Final = 2
"""The exit code of a command that names what it lacks."""


def installations() -> Rows:
    """One row per Python and extra."""
    head = ["Python", "installed", *MACHINE[1:], "runs", "says what it lacks"]
    rows = [head]
    with tempfile.TemporaryDirectory() as folder:
        wheel = _wheel(Path(folder))
        rows += [_row(python, wheel, extra, Path(folder)) for python in _pythons() for extra in EXTRAS]
    return rows


def _pythons() -> list[str]:
    named = os.environ.get("PYTHONS", "").split()
    found = [path for version in VERSIONS if (path := shutil.which(f"python{version}")) is not None]
    return named or found or [sys.executable]


def _wheel(folder: Path) -> Path:
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir"]
    subprocess.run([*build, str(folder), str(ROOT)], check=True)
    return next(folder.glob("fanet_mw-*.whl"))


def _row(python: str, wheel: Path, extra: str, folder: Path) -> list[str]:
    place = folder / "environment"
    shutil.rmtree(place, ignore_errors=True)
    subprocess.run([python, "-m", "venv", str(place)], check=True)
    install = [place / "bin" / "pip", "install", "--quiet", "--only-binary", ":all:", f"{wheel}{extra}"]
    subprocess.run(install, check=True, stderr=subprocess.DEVNULL)
    version = _out(place, "python", "-c", "import platform; print(platform.python_version())")
    packages = [line for line in _out(place, "pip", "list", "--format=freeze").splitlines() if line]
    ours = [line for line in packages if not line.startswith(("pip==", "setuptools=="))]
    work = folder / "empty"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(work)}
    fanet = str(place / "bin" / "fanet")
    starts, _ = _timed([fanet, "--version"], work, environment)
    first, code = _timed([fanet, "simulate", "quick"], work, environment)
    again = _timed([fanet, "simulate", "quick"], work, environment)[0] if code == 0 else None
    runs, lacks = [], []
    for command in COMMANDS:
        _, code = _timed([fanet, *command], work, environment)
        name = " ".join(command[:2]) if command[0] in ("simulate", "launch") else command[0]
        (runs if code in (0, 1) else lacks if code == _SAYS_WHICH else []).append(name)
    return [
        version, f"`fanet-mw{extra}`", str(len(ours)), f"{_megabytes(place):.0f}", f"{starts:.1f} s",
        f"{first:.0f} s" if again is not None else "-", f"{again:.1f} s" if again is not None else "-",
        ", ".join(runs), ", ".join(lacks) or "-",
    ]  # fmt: skip


def _out(place: Path, *command: str) -> str:
    return subprocess.run(
        [place / "bin" / command[0], *command[1:]], check=True, capture_output=True, text=True
    ).stdout.strip()


def _timed(command: list[str], work: Path, environment: dict[str, str]) -> tuple[float, int]:
    began = time.monotonic()
    ended = subprocess.run(command, cwd=work, env=environment, capture_output=True, text=True, check=False, timeout=600)
    crashed = "Traceback" in ended.stderr
    return time.monotonic() - began, _CRASHED if crashed else ended.returncode


def _megabytes(place: Path) -> float:
    """What is installed, without pip and setuptools, which every environment has, and without compiled caches."""
    return sum(_sizes(next(place.glob("lib/python3*/site-packages")))) / 1e6


def _sizes(site: Path) -> Iterator[int]:
    for item in site.iterdir():
        if not item.name.startswith(("pip", "setuptools", "pkg_resources", "_distutils_hack", "__pycache__")):
            files = item.rglob("*") if item.is_dir() else iter([item])
            yield from (file.stat().st_size for file in files if file.is_file() and file.suffix != ".pyc")
