"""An environment in which fanet-mw and the example package are installed from their wheels, as their users have them.

What they depend on comes from the environment of the tests. Nothing of the checkout is on the path of its Python.
"""

import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"


class Installed(NamedTuple):
    """The environment."""

    folder: Path

    @property
    def python(self) -> str:
        return str(self.folder / "bin" / "python")

    @property
    def fanet(self) -> str:
        return str(self.folder / "bin" / "fanet")

    @property
    def site(self) -> Path:
        return next(self.folder.glob("lib/python*/site-packages"))

    @property
    def environment(self) -> dict[str, str]:
        """Nothing of the checkout is in it; the kernel is not compiled, because that would take half a minute, but for
        the machine code of the same sources.
        """
        path = f"{self.folder / 'bin'}:/usr/bin:/bin"
        found = {"PATH": path, "HOME": str(self.folder)}
        return (
            found
            if any((self.site / "emulator" / "__pycache__").glob("kernel-*"))
            else {**found, "FANET_NO_NUMBA": "1"}
        )

    def run(self, *command: str, cwd: Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command, cwd=cwd, env=self.environment, capture_output=True, text=True, timeout=110, check=False
        )


def install(folder: Path) -> Installed:
    """Build both wheels and install them into a new environment in `folder`."""
    place, wheels = Installed(folder / "environment"), folder / "wheels"
    for project in (ROOT, EXAMPLES / "swarm-parts"):
        build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(wheels)]
        subprocess.run(build, cwd=project, check=True, capture_output=True, timeout=100)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(place.folder)], check=True, timeout=60)
    pip = [sys.executable, "-m", "pip", "--python", place.python, "install", "--quiet", "--no-deps", "--no-index"]
    found = [str(path) for path in sorted(wheels.glob("*.whl"))]
    subprocess.run([*pip, "--no-compile", *found], check=True, capture_output=True, timeout=100)
    _take_machine_code(place.site / "emulator")
    (place.site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return place


def _take_machine_code(package: Path) -> None:
    """Give a package what numba has compiled of the same sources here: numba knows them by folder, time and size."""
    for kept in (ROOT / "emulator" / "__pycache__").glob("kernel-*"):
        for folder in kept.iterdir():
            name, _, digest = folder.name.rpartition("_")
            if folder.is_dir() and digest == hashlib.sha1(str(ROOT / "emulator" / name).encode()).hexdigest():
                theirs = hashlib.sha1(str(package / name).encode()).hexdigest()
                shutil.copytree(folder, package / "__pycache__" / kept.name / f"{name}_{theirs}")
            elif not folder.is_dir():
                (package / "__pycache__" / kept.name).mkdir(parents=True, exist_ok=True)
                shutil.copy(folder, package / "__pycache__" / kept.name)
    for path in package.rglob("*.py"):
        ours = (ROOT / "emulator" / path.relative_to(package)).stat()
        os.utime(path, ns=(ours.st_atime_ns, ours.st_mtime_ns))
