"""ns-3.44 itself, run beside ours: `swarm.cc` and `models.cc` in this folder, compiled against an installed ns-3.

PREFIX is a folder with `include` and `lib64` of ns-3.44, such as `site-packages/ns3` of an environment in which `pip
install ns3==3.44.post0` was run. It needs g++ too; neither is a dependency of ours.
"""

import json
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

_SOURCES: Final = Path(__file__).parent
_MODULES: Final = ("core", "network", "internet", "mobility", "wifi", "propagation")


def build(prefix: Path, folder: Path, name: str = "swarm") -> Path:
    """The program, compiled into `folder`; raises CalledProcessError when that fails."""
    program = folder / name
    libraries = prefix / "lib64"
    command = ["g++", "-O2", "-std=c++20", f"-I{prefix / 'include'}", str(_SOURCES / f"{name}.cc"), "-o", str(program)]
    command += [f"-L{libraries}", f"-Wl,-rpath,{libraries}", *(f"-lns3.44-{module}" for module in _MODULES)]
    subprocess.run(command, check=True)
    return program


def run(program: Path, **settings: object) -> dict[str, Any]:
    """What one simulation says of itself; the settings are those of `swarm.cc`."""
    command = [str(program), *(f"--{name}={value}" for name, value in settings.items())]
    said: dict[str, Any] = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    return said


def transmissions(
    program: Path, places_m: Iterable[int], sends: Iterable[tuple[int, int, int]], *, channel: str = "A"
) -> list[tuple[int, int]]:
    """Who began to transmit when [ns], on a line of nodes 1, 2, ...; `sends`: node, instant [ns] and bytes."""
    numbers = [str(number) for node, at_ns, size in sends for number in (node - 1, at_ns, size)]
    places = ",".join(str(place_m) for place_m in places_m)
    said = run(program, topology="line", channel=channel, places=places, sends=",".join(numbers))
    return [(node + 1, began_ns) for node, began_ns in said["began"]]
