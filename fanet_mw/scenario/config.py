"""Reads a scenario: a TOML file and `KEY=VALUE` overrides become a frozen `Scenario`. All mistakes are reported at
once.

Each message names the file, the key, the value and the bound, because the user may see nothing but that line
(`validation_errors.py`).
"""

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.overrides import apply_override
from fanet_mw.scenario.quantities import in_unit_of, unit_of
from fanet_mw.scenario.tables.world import FILE_KEYS
from fanet_mw.scenario.validation_errors import sentence


def load(path: Path, overrides: Iterable[str] = ()) -> Scenario:
    """Read one scenario file; raises ConfigError with all mistakes of the file and the overrides."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    return parse(text, source=str(path), name=path.stem, overrides=overrides, folder=path.parent)


def parse(text: str, *, source: str, name: str, overrides: Iterable[str] = (), folder: Path | None = None) -> Scenario:
    """Build a scenario from TOML text; `source` is what messages call it, `name` its name unless it has its own.

    Paths in the text are taken from `folder`, those in overrides from the current one.
    """
    try:
        tree: dict[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{source}: not valid TOML: {error}") from error
    tree.setdefault("name", name)
    if folder is not None:
        _from_folder(tree, folder)
    for override in overrides:
        apply_override(tree, override)
    return build(tree, source=source)


def build(tree: Mapping[str, Any], *, source: str = "scenario") -> Scenario:
    """Validate a tree of plain values; a number may be text with a unit, which its key turns into its own."""
    problems: list[str] = []
    tree = {key: _plain(key, value, problems, key) for key, value in tree.items()}
    if problems:
        raise ConfigError("\n".join(f"{source}: {problem}" for problem in problems))
    try:
        return Scenario.model_validate(tree)
    except ValidationError as error:
        lines = [sentence(dict(item)) for item in error.errors()]
        raise ConfigError("\n".join(f"{source}: {text}" for text in dict.fromkeys(lines))) from error


def departures(scenario: Scenario) -> dict[str, Any]:
    """The values of a scenario that differ from the defaults, as a tree of plain values from which it can be built
    again.

    If the default of a key depends on another key that was changed, the value is included: a rate of 11 Mb/s is the
    default, but not for 802.11g.
    """
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


def _from_folder(tree: dict[str, Any], folder: Path) -> None:
    """Make the paths of other files in a tree absolute, taken from a folder."""
    traffic = tree.get("traffic")
    for number, table in enumerate(traffic if isinstance(traffic, list) else [traffic]):
        if isinstance(table, dict) and isinstance(table.get("packets_csv"), str) and table["packets_csv"]:
            table["packets"] = _packets(folder / table.pop("packets_csv"), f"traffic.{number}.packets_csv")
    world = tree.get("world")
    if not isinstance(world, dict):
        return
    for key in FILE_KEYS:
        if isinstance(world.get(key), str) and world[key]:
            world[key] = str(folder.absolute() / world[key])


def _packets(path: Path, key: str) -> list[list[str]]:
    """The packets of a file with `seconds,bytes` on each line; raises ConfigError with the line that is wrong."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{key} = {path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    found = []
    for number, line in enumerate(lines, start=1):
        cells = [cell.strip() for cell in line.split(",")]
        if not line.strip() or line.startswith("#") or (number == 1 and not _is_number(cells[0])):
            continue  # a heading or an empty line
        if len(cells) != 2 or not all(_is_number(cell) for cell in cells):
            raise ConfigError(f"{key} = {path}, line {number}: {line!r} must be seconds,bytes")
        found.append(cells)
    return found


def _is_number(text: str) -> bool:
    return text.replace(".", "", 1).replace("e-", "", 1).isdecimal()


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
    return value if number is None else number
