"""Overrides of a scenario, as `--set KEY=VALUE` on the command line: one value of its tree is set.

nodes.count=10            a key of a table, with the tables' names before it
traffic.1.interval_s=2    a key of an entry of an array of tables, by the number of the entry from 0
radio.lead_ms=60ms        a value with a unit, which its key converts (`quantities.py`)
"""

import tomllib
from typing import Any

from fanet_mw.errors import ConfigError


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
