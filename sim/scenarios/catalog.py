"""The shipped scenarios, and finding one by name or path."""

import difflib
import tomllib
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from agents.mission.searcher import formation, least_nodes
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario, config


class Entry(NamedTuple):
    """One shipped scenario."""

    name: str
    description: str
    text: str


def shipped() -> list[Entry]:
    """All shipped scenarios, by name."""
    entries = []
    for item in sorted(files("sim.scenarios").iterdir(), key=lambda item: item.name):
        if item.name.endswith(".toml"):
            text = item.read_text(encoding="utf-8")
            entries.append(Entry(item.name.removesuffix(".toml"), tomllib.loads(text).get("description", ""), text))
    return entries


def find(name: str, overrides: Iterable[str] = ()) -> Scenario:
    """The scenario of a file (anything with a slash or ending in .toml), else the shipped one of that name."""
    if _is_file(name):
        return _searchable(config.load(Path(name), overrides), name)
    source = f"scenario {name}"
    return _searchable(config.parse(_shipped(name).text, source=source, name=name, overrides=overrides), source)


def _searchable(scenario: Scenario, source: str) -> Scenario:
    """A scenario whose UAVs are enough for the search that it asks for; raises ConfigError otherwise."""
    count, area_m = scenario.nodes.count, scenario.world.area_m
    if scenario.mission.search == "lines" and formation(scenario, count) is None:
        raise ConfigError(
            f"{source}: nodes.count = {count}: mission.search = 'lines' over world.area_m = {area_m:g} needs at least "
            f"{least_nodes(scenario)} UAVs with radio.range_m = {scenario.radio.range_m:g}"
        )
    return scenario


def text_of(name: str) -> str:
    """The text of a scenario that is right: of a file, or of the shipped one of that name."""
    find(name)
    return Path(name).read_text(encoding="utf-8") if _is_file(name) else _shipped(name).text


def _is_file(name: str) -> bool:
    return name.endswith(".toml") or "/" in name


def _shipped(name: str) -> Entry:
    entries = {entry.name: entry for entry in shipped()}
    if name not in entries:
        close = difflib.get_close_matches(name, entries, n=1)
        hint = f"did you mean {close[0]}?" if close else f"shipped: {', '.join(entries)}; or give a .toml file"
        raise ConfigError(f"unknown scenario {name!r}; {hint}")
    return entries[name]
