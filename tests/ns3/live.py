"""ns-3.44 itself, run beside ours: `swarm.cc` in this folder, compiled against an installed ns-3.

PREFIX is a folder with `include` and `lib64` of ns-3.44, such as `site-packages/ns3` of an environment in which `pip
install ns3==3.44.post0` was run. It needs g++ too; neither is a dependency of ours.
"""

import json
import subprocess
from pathlib import Path
from typing import Final

_SOURCE: Final = Path(__file__).parent / "swarm.cc"
_MODULES: Final = ("core", "network", "internet", "mobility", "wifi", "propagation")


def build(prefix: Path, folder: Path) -> Path:
    """The program, compiled into `folder`; raises CalledProcessError when that fails."""
    program = folder / "swarm"
    libraries = prefix / "lib64"
    command = ["g++", "-O2", "-std=c++20", f"-I{prefix / 'include'}", str(_SOURCE), "-o", str(program)]
    command += [f"-L{libraries}", f"-Wl,-rpath,{libraries}", *(f"-lns3.44-{module}" for module in _MODULES)]
    subprocess.run(command, check=True)
    return program


def run(program: Path, **settings: object) -> dict[str, float]:
    """What one simulation says of itself; the settings are those of `swarm.cc`."""
    command = [str(program), *(f"--{name}={value}" for name, value in settings.items())]
    said: dict[str, float] = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    return said
