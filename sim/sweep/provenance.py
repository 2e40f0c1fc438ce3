"""Identifies the code that produced a row: the version, and a digest of the sources on which a row depends.

The scenario of a run is not in it: whatever a shipped scenario file sets is part of the key of the run (`tasks.py`).
"""

import functools
import hashlib
from importlib.resources import files
from pathlib import Path
from typing import Final

from fanet_mw import __version__

_PARTS: Final = (
    ("fanet_mw", "**/*.py"), ("agents", "**/*.py"), ("emulator", "**/*.py"), ("sim.records", "**/*.py"),
    ("sim.run", "**/*.py"), ("sim.results", "**/*.py"), ("sim.world", "**/*.py"), ("sim.sweep", "measures.py"),
)  # fmt: skip
"""Changes in the command line, in the rest of sweeps and in figures change no row, so the digest leaves them out."""


@functools.cache
def code() -> str:
    """The version and the digest, for example `0.1.0+3f2a9c01`."""
    folders = [(package, Path(str(files(package))), pattern) for package, pattern in _PARTS]
    sources = ((name, folder, path) for name, folder, pattern in folders for path in sorted(folder.glob(pattern)))
    return f"{__version__}+{digest({f'{name}/{path.relative_to(at).as_posix()}': path for name, at, path in sources})}"


def digest(sources: dict[str, Path]) -> str:
    whole = hashlib.sha256()
    for name, path in sources.items():
        whole.update(f"{name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return whole.hexdigest()[:8]
