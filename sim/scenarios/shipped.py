"""The shipped scenarios as texts, by name."""

import difflib
import tomllib
from collections.abc import Collection
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from fanet_mw.errors import ConfigError


class Entry(NamedTuple):
    """One shipped scenario: its name and its description."""

    name: str
    description: str
    text: str


@cache
def shipped() -> tuple[Entry, ...]:
    """All shipped scenarios, by name. They are read once: reading them takes longer than all else about finding one."""
    entries = []
    for item in sorted(files("sim.scenarios").iterdir(), key=lambda item: item.name):
        if item.name.endswith(".toml"):
            text = item.read_text(encoding="utf-8")
            entries.append(Entry(item.name.removesuffix(".toml"), tomllib.loads(text).get("description", ""), text))
    return tuple(entries)


def is_file(name: str, known: Collection[str]) -> bool:
    """True if what a user names is a file, and not a known thing: it has a slash, ends in .toml, or is there."""
    return name.lower().endswith(".toml") or "/" in name or (name not in known and Path(name).is_file())


def entry(name: str) -> Entry:
    """The shipped scenario of a name; raises ConfigError if there is none."""
    entries = {entry.name: entry for entry in shipped()}
    if name not in entries:
        close = difflib.get_close_matches(name, entries, n=1)
        hint = f"did you mean {close[0]}?" if close else f"shipped: {', '.join(entries)}; or give a .toml file"
        raise ConfigError(f"unknown scenario {name!r}; {hint}")
    return entries[name]
