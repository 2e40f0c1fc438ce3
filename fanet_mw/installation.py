"""Checks that this installation is complete: no package overwritten by another distribution, no extra missing.

The distribution fanet-mw has four top-level packages, and other distributions use some of the same names
(`openai-agents` has `agents`). If both are installed, the later one overwrites files of the earlier one.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import Final

PACKAGES: Final = ("agents", "emulator", "sim")
_MARK: Final = "fanet-mw"
"""A text that is among the first lines of each package of this distribution."""
_EXTRAS: Final = {
    "numpy": "emulator",
    "numba": "emulator",
    "pybullet": "pybullet",
    "pyarrow": "sweep",
    "distributed": "dask",
    "matplotlib": "figures",
    "rasterio": "maps",
    "mcap": "record",
    "mcap_protobuf": "record",
    "foxglove_schemas_protobuf": "record",
    "google": "record",
    "trimesh": "view",
    "viser": "view",
    "textual": "inspect",
}
_REMEDY: Final = (
    "install fanet-mw into an environment of its own: python3 -m venv fanet && fanet/bin/pip install 'fanet-mw[all]'"
)


def damage() -> str | None:
    """What is wrong with this installation, and how to repair it; None if it is complete. No package is imported."""
    for package in PACKAGES:
        spec = find_spec(package)
        if spec is None or (spec.origin is None and not spec.submodule_search_locations):
            return f"the package {package!r} of fanet-mw is not there (another distribution removed it?); {_REMEDY}"
        path = Path(spec.origin or next(iter(spec.submodule_search_locations or ())))
        if spec.origin is None or _MARK not in path.read_text(encoding="utf-8", errors="replace"):
            place = path.parent if path.name == "__init__.py" else path
            return (
                f"{place} is not the package {package!r} of fanet-mw, and comes before it on sys.path or has "
                f"overwritten it; if it is yours, give it another name or take its folder off the path, else {_REMEDY}"
            )
    return None


def missing_extra(error: ModuleNotFoundError, what: str = "this command") -> str | None:
    """How to install a missing module that `what` needs; None if no extra of this distribution has it."""
    extra = _EXTRAS.get((error.name or "").partition(".")[0])
    if extra is None:
        return None
    return f"{what} needs {error.name}, which is not installed: pip install 'fanet-mw[{extra}]'"
