"""Is this installation whole? A package may have been overwritten by another distribution, or an extra be missing.

The distribution fanet-mw has four packages at the top level, and other distributions have some of the same names
(`openai-agents` has `agents`): installed into one environment, the later one overwrites files of the earlier one.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import Final

PACKAGES: Final = ("agents", "emulator", "sim")
"""The packages of this distribution besides `fanet_mw`."""
_MARK: Final = "fanet-mw"
"""A text that is among the first lines of each package of this distribution."""
_EXTRAS: Final = {
    "numpy": "emulator",
    "numba": "emulator",
    "pybullet": "pybullet",
    "pyarrow": "sweep",
    "distributed": "dask",
    "matplotlib": "figures",
}
"""The extra that installs a module."""
_REMEDY: Final = (
    "install fanet-mw into an environment of its own: python3 -m venv fanet && fanet/bin/pip install 'fanet-mw[all]'"
)


def damage() -> str | None:
    """What is wrong with this installation, and the remedy; None when it is whole. None of the packages is imported."""
    for package in PACKAGES:
        spec = find_spec(package)
        if spec is None or spec.origin is None:
            return f"the package {package!r} of fanet-mw is not there (another distribution removed it?); {_REMEDY}"
        path = Path(spec.origin)
        if _MARK not in path.read_text(encoding="utf-8", errors="replace"):
            return f"{path.parent} is not the package {package!r} of fanet-mw{_owner(package)}; {_REMEDY}"
    return None


def missing_extra(error: ModuleNotFoundError, what: str = "this command") -> str | None:
    """What to install for a missing module that `what` needs; None when no extra of this distribution has it."""
    extra = _EXTRAS.get((error.name or "").partition(".")[0])
    if extra is None:
        return None
    return f"{what} needs {error.name}, which is not installed: pip install 'fanet-mw[{extra}]'"


def _owner(package: str) -> str:
    """The other distributions that claim to have installed a package of this name."""
    from importlib.metadata import packages_distributions  # reads email parsers: only when there is something to say

    others = sorted({name for name in packages_distributions().get(package, ()) if name != "fanet-mw"})
    return f": it was installed by {', '.join(others)}" if others else ""
