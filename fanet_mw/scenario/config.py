"""Reads a scenario: a TOML file and `KEY=VALUE` overrides become a frozen `Scenario`; all mistakes are told at once.

nodes.count=10            a key of a table, with the tables' names before it
traffic.1.interval_s=2    a key of an entry of an array of tables, by the number of the entry from 0
radio.lead_ms=60ms        a value with a unit, which its key converts (`quantities.py`)
"""

import contextlib
import re
import tomllib
import unicodedata
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from fanet_mw.errors import ConfigError
from fanet_mw.extensions import AS_TEXT
from fanet_mw.foreign_file import require_plain, toml_of
from fanet_mw.scenario import Scenario, map_files
from fanet_mw.scenario.packets_csv import packets_of
from fanet_mw.scenario.quantities import in_unit_of, unit_of
from fanet_mw.scenario.tables.world import FILE_KEYS
from fanet_mw.scenario.text_files import read_text
from fanet_mw.scenario.validation_errors import sentences


def load(path: Path, overrides: Iterable[str] = ()) -> Scenario:
    """Read one scenario file; raises ConfigError with all mistakes of the file and the overrides."""
    text = read_text(path, what=str(path))
    return parse(text, source=str(path), name=_name_of(path), overrides=overrides, folder=path.parent)


def _name_of(path: Path) -> str:
    letters = unicodedata.normalize("NFKD", path.stem).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9_-]+", "-", letters).strip("-")[:64] or "unnamed"


def parse(text: str, *, source: str, name: str, overrides: Iterable[str] = (), folder: Path | None = None) -> Scenario:
    """A scenario from TOML; `source`: in messages, `name`: unless it has its own. Paths in it are from `folder`, in
    overrides from here.
    """
    tree = toml_of(text, source=source)
    tree.setdefault("name", name)
    laid_about = None if folder is None else _from_folder(tree, folder)
    if isinstance(overrides, str) or not isinstance(overrides, Iterable):
        raise ConfigError(f"overrides = {overrides!r}: must be a sequence of KEY=VALUE, not one text")
    for override in overrides:
        apply_override(tree, override)
    world = tree.get("world")
    if laid_about is not None and isinstance(world, dict) and map_files.origin_of(world) != laid_about:
        raise ConfigError(
            f"{source}: --set changes world.origin_deg, but its area, no-fly areas or people of other files are laid "
            f"about [{laid_about[0]:g}, {laid_about[1]:g}]; change it in the file"
        )
    return build(tree, source=source)


def build(tree: Mapping[str, Any], *, source: str = "scenario", imports: bool = True) -> Scenario:
    """Validate plain values; a number may be text with a unit. Without `imports`, foreign parts stay names."""
    require_plain(tree, source=source)
    problems: list[str] = []
    tree = {key: _plain(key, value, problems, key) for key, value in tree.items()}
    if problems:
        raise ConfigError("\n".join(f"{source}: {problem}" for problem in problems))
    try:
        return Scenario.model_validate(tree, context=None if imports else AS_TEXT)
    except ValidationError as error:
        raise ConfigError("\n".join(f"{source}: {text}" for text in sentences(error))) from error


def departures(scenario: Scenario) -> dict[str, Any]:
    """What differs from the defaults, as plain values to build from; also defaults that depend on changed keys."""
    whole = scenario.model_dump(mode="json", exclude_none=True)
    tree = scenario.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    try:
        again = build({"name": scenario.name, **tree}).model_dump(mode="json", exclude_none=True)
    except ConfigError:
        return whole
    for key, value in whole.items():
        if value == again.get(key):
            continue
        if isinstance(value, dict):
            others = again.get(key, {})
            tree[key] = {k: v for k, v in value.items() if k in tree.get(key, {}) or v != others.get(k)}
        else:
            tree[key] = value
    return tree


def _from_folder(tree: dict[str, Any], folder: Path) -> tuple[float, float] | None:
    """Make the paths of other files in a tree absolute, taken from a folder; returns the origin of places on earth."""
    traffic = tree.get("traffic")
    for number, table in enumerate(traffic if isinstance(traffic, list) else [traffic]):
        if isinstance(table, dict) and isinstance(table.get("packets_csv"), str) and table["packets_csv"]:
            table["packets"] = packets_of(folder / table.pop("packets_csv"), key=f"traffic.{number}.packets_csv")
    laid_about = map_files.take_in(tree, folder)
    world = tree.get("world")
    if isinstance(world, dict):
        for key in FILE_KEYS:
            if isinstance(world.get(key), str) and world[key]:
                world[key] = str(folder.absolute() / world[key])
    return laid_about


def _plain(key: str, value: object, problems: list[str], path: str) -> object:
    """A value without its unit; what is wrong with the unit is added to `problems`."""
    if isinstance(value, Mapping):
        return {name: _plain(name, inner, problems, f"{path}.{name}") for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(key, inner, problems, f"{path}.{index}") for index, inner in enumerate(value)]
    if not isinstance(value, str) or not unit_of(key):
        return value
    try:
        number = in_unit_of(key, value)
    except ValueError as error:
        problems.append(f"{path} = {value!r}: {error}")
        return value
    return _number(value) if number is None else number


def _number(text: str) -> object:
    """The number that a text is, so that defaults follow from it as from a number; else the text."""
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text


def apply_override(tree: dict[str, Any], override: str) -> None:
    """Set one dotted key; the value is TOML, or otherwise taken as a string."""
    key, equals, text = str(override).partition("=")
    key = key.strip()
    if not equals or not key:
        raise ConfigError(f"--set {override!r}: must be KEY=VALUE, for example nodes.count=10")
    *path, last = key.split(".")
    table: Any = tree
    for part in path:
        inner = _entry(table, part, override) if isinstance(table, list) else table.setdefault(part, {})
        if not isinstance(inner, dict | list):
            raise ConfigError(f"--set {override!r}: {part!r} is a value, not a table")
        table = inner
    if isinstance(table, list):
        _entry(table, last, override)
        table[int(last)] = one_value(text.strip())
    else:
        table[last] = one_value(text.strip())


def _entry(entries: list[Any], part: str, override: str) -> Any:  # noqa: ANN401  (a value of a TOML file)
    if not part.isdecimal() or int(part) >= len(entries):
        raise ConfigError(f"--set {override!r}: {part!r} must be the number of an entry, 0 to {len(entries) - 1}")
    return entries[int(part)]


def one_value(text: str) -> object:
    """The value of some TOML text; text that is no TOML is a string, so that names need no quotes."""
    try:
        tree = tomllib.loads(f"value = {text}")
        return tree["value"] if len(tree) == 1 else text
    except (
        ValueError,
        RecursionError,
    ):  # no TOML, thousands of digits or of brackets: whoever checks the key refuses it
        return text
