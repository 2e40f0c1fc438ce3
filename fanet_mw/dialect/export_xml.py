"""Writes the XML of the MAVLink dialect together with what it includes, as the installed pymavlink has it."""

import re
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Final

from fanet_mw.errors import ConfigError
from fanet_mw.whole_file import replace_file

NAME: Final = "fanet.xml"
_INCLUDE: Final = re.compile(r"<include>\s*(\S+?)\s*</include>")


def write(folder: Path) -> Path:
    """Write `v1.0/fanet.xml` and what it includes; returns its path. Raises ConfigError."""
    target = folder / "v1.0"
    ours, theirs = files("fanet_mw.dialect"), files("pymavlink.dialects.v20")
    try:
        target.mkdir(parents=True, exist_ok=True)
        for name, text in _with_included(ours / NAME, theirs).items():
            replace_file(target / name, text.encode())
    except FileNotFoundError as error:
        raise ConfigError(f"{error.filename}: is missing: install pymavlink anew") from error
    except OSError as error:
        raise ConfigError(f"{target}: cannot be written: {error.strerror}") from error
    return target / NAME


def _with_included(source: Traversable, theirs: Traversable) -> dict[str, str]:
    """The texts of a definition and of all definitions that it includes, by file name."""
    found: dict[str, str] = {}
    wanted = [source]
    while wanted:
        file = wanted.pop()
        found[file.name] = file.read_text(encoding="utf-8")
        wanted += [theirs / name for name in _INCLUDE.findall(found[file.name]) if name not in found]
    return found
