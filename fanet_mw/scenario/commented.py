"""Writes a scenario file for people: a comment above each key has its meaning, unit and bound.

Keys with their default values are commented out, ready to be changed.
"""

import json
import textwrap
from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Any, Final

import tomli_w

from fanet_mw.scenario.reference import REQUIRED, Key, KeyTable, tables

_WIDTH: Final = 100
SCHEMA_NAME: Final = "fanet-scenario.schema.json"
"""The file of the JSON schema that a scenario file names in its first line, for editors."""


def commented(tree: Mapping[str, Any], *, every_key: bool = True, schema: bool = False) -> str:
    """A scenario file that reads back as `tree`, or with `every_key`; `schema`: named in its first line."""
    lines = [f"#:schema ./{SCHEMA_NAME}"] if schema else []
    if every_key:
        lines += ["# A key behind # has its default. `fanet check FILE` says whether the file is right.", ""]
    for path, group in groupby(tables(), key=lambda table: table.path):
        kinds = list(group)
        given = tree.get(path) if path else tree
        if isinstance(given, list | tuple):
            lines += [*_entries(path, given), *(line for table in kinds if every_key for line in _outline(table))]
        elif isinstance(given, Mapping):
            lines += _table(_of_kind(kinds, given), given, every_key=every_key)
        elif every_key:
            lines += [line for table in kinds for line in (_outline(table) if table.repeated else _table(table, {}))]
    return "\n".join(lines).strip() + "\n"


def _of_kind(kinds: list[KeyTable], given: Mapping[str, Any]) -> KeyTable:
    """The table of the kind that the given values name; the first one if they name none."""
    return next(
        (table for table in kinds if table.heading and table.heading == f'kind = "{given.get("kind")}"'), kinds[0]
    )


def _table(table: KeyTable, given: Mapping[str, Any], *, every_key: bool = True) -> Iterator[str]:
    keys = [key for key in table.keys if every_key or key.name in given]
    if table.path and (keys or given):
        yield from ("", *_comment(table.meaning), f"[{table.path}]")
    for key in keys:
        yield from ("", *_comment(_sentence(key))) if every_key else _comment(_sentence(key))
        if key.name in given:
            yield _assignment(key.name, given[key.name])
        else:
            yield f"# {key.name} = {_default(key)}"


def _entries(path: str, given: list[Any] | tuple[Any, ...]) -> Iterator[str]:
    for entry in given:
        yield from ("", f"[[{path}]]", *(_assignment(name, value) for name, value in entry.items()))


def _assignment(name: str, value: object) -> str:
    """A key and its value, on lines that fit any table; a nested table is written inline."""
    if isinstance(value, Mapping):
        inside = ", ".join(_assignment(str(key), inner) for key, inner in value.items())
        return f"{_bare_or_quoted(name)} = {{{inside}}}"
    return tomli_w.dumps({name: value}).rstrip()


def _bare_or_quoted(name: str) -> str:
    return tomli_w.dumps({name: 0}).removesuffix(" = 0\n")


def _outline(table: KeyTable) -> Iterator[str]:
    """An example entry of an array of tables, commented out."""
    yield from ("", *_comment(table.meaning), f"# [[{table.path}]]")
    for key in table.keys:
        value = table.heading.partition(" = ")[2] if key.name == "kind" else _default(key)
        yield f"# {key.name} = {value}  # {_sentence(key)}"


def _sentence(key: Key) -> str:
    unit = f" {key.unit}" if key.unit else ""
    return f"{key.meaning} [{key.bound}{unit}]"


def _default(key: Key) -> str:
    if key.default is REQUIRED:
        return "..."
    if key.default is None:
        return "(unset)"
    return json.dumps(key.default)


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="# ", break_long_words=False)
