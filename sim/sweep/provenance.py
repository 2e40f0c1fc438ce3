"""Identifies the code that produced a row: the version, and a digest of all source files on which a run's result
depends.
"""

import functools
import hashlib
from importlib.resources import files
from pathlib import Path
from typing import Final

from fanet_mw import __version__

_PACKAGES: Final = (
    "fanet_mw", "agents", "emulator", "sim.run", "sim.results", "sim.world",
)  # fmt: skip
"""Changes in the command line, in sweeps and in figures change no run, so the digest leaves them out."""


@functools.cache
def code() -> str:
    """The version and the digest, for example `0.1.0+3f2a9c01`."""
    digest = hashlib.sha256()
    for package in _PACKAGES:
        folder = Path(str(files(package)))
        for path in sorted(folder.rglob("*.py")):
            digest.update(str(path.relative_to(folder)).encode())
            digest.update(path.read_bytes())
    return f"{__version__}+{digest.hexdigest()[:8]}"
