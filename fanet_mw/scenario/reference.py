"""All that is known about the keys of a scenario, read from the models: table, unit, bound, default and meaning.

The reference page, the comments that `fanet init` writes, and the completion of keys all use it.
"""

import json
import re
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, Final, NamedTuple

from fanet_mw.scenario.model import Scenario
from fanet_mw.scenario.quantities import unit_of
from fanet_mw.scenario.tables.sections import meanings, tables_of

Schema = Mapping[str, Any]
_REFERENCE: Final = "#/$defs/"
REQUIRED: Final = object()
"""Stands for the default of a key without one."""


class Key(NamedTuple):
    """One key of a table."""

    name: str
    unit: str
    bound: str
    default: object
    meaning: str


class KeyTable(NamedTuple):
    """One table of a scenario file."""

    path: str
    """The path as in the file, for example `radio`; empty for the keys before all tables."""
    heading: str
    """The setting that distinguishes this table from others with the same path, for example `kind = "jam"`."""
    repeated: bool
    """True for an array of tables: `[[faults]]`."""
    meaning: str
    keys: tuple[Key, ...]

    @property
    def title(self) -> str:
        brackets = f"[[{self.path}]]" if self.repeated else f"[{self.path}]"
        return f"{brackets} {self.heading}".strip() if self.path else "Top level"


def json_schema() -> dict[str, Any]:
    """The JSON schema of a scenario file, with descriptions, for editors and other tools."""
    schema = _single_lines(_described(Scenario.model_json_schema()))
    assert isinstance(schema, dict), "the schema of a model is an object"
    del schema["description"]
    keys = schema["properties"]
    one = keys.pop("further_traffic")["items"]  # in a file it is the same table several times
    keys["traffic"] = {"anyOf": [one, {"type": "array", "items": one}]}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "fanet-mw scenario"}


def _described(schema: dict[str, Any]) -> dict[str, Any]:
    """A schema with the meaning of each key."""
    for table in set(tables_of(Scenario)):
        keys = schema["properties"] if table is Scenario else schema["$defs"][table.__name__]["properties"]
        for key, meaning in meanings(table).items():
            keys[key]["description"] = meaning
    return schema


@cache
def tables() -> tuple[KeyTable, ...]:
    """All tables of a scenario file; the keys before all tables come first."""
    schema = json_schema()
    return tuple(_tables("", schema, schema["$defs"], meaning="One file is one scenario.", repeated=False))


def dotted_keys() -> list[str]:
    """All keys that `--set` accepts, except those in arrays of tables."""
    return [f"{table.path}.{key.name}".lstrip(".") for table in tables() if not table.repeated for key in table.keys]


def _tables(
    path: str, model: Schema, models: Mapping[str, Schema], *, meaning: str, repeated: bool, heading: str = ""
) -> Iterator[KeyTable]:
    inner: list[tuple[str, str, str, set[bool]]] = []
    keys = []
    needed = model.get("required", ())
    for name, schema in model["properties"].items():
        references: dict[str, set[bool]] = {}
        for model_name, many in _references(schema):
            references.setdefault(model_name, set()).add(many)
        if references:
            said = schema.get("description", "")
            inner += [
                (f"{path}.{name}".lstrip("."), model_name, said, forms) for model_name, forms in references.items()
            ]
            continue
        default = REQUIRED if name in needed else schema.get("default")
        keys.append(Key(name, _unit(name, schema), bound(schema), default, schema.get("description", "")))
    yield KeyTable(path, heading, repeated, meaning, tuple(keys))
    for inner_path, model_name, said, forms in inner:
        one = models[model_name]
        kind = one["properties"].get("kind", {}).get("const")
        yield from _tables(
            inner_path,
            one,
            models,
            meaning=f"{one.get('description', '')} {said}".strip(),
            repeated=False not in forms,
            heading="" if kind is None else f'kind = "{kind}"',
        )


def _references(schema: Schema, *, many: bool = False) -> Iterator[tuple[str, bool]]:
    """(model, whether in an array) for each table that a value may be."""
    if "$ref" in schema:
        yield schema["$ref"].removeprefix(_REFERENCE), many
    for word in ("anyOf", "oneOf", "allOf"):
        for part in schema.get(word, ()):
            yield from _references(part, many=many)
    if isinstance(schema.get("items"), dict):
        yield from _references(schema["items"], many=True)


def _unit(name: str, schema: Schema) -> str:
    unit = schema.get("unit", unit_of(name))
    return str(unit) if "number" in (types := set(_types(schema))) or "integer" in types else ""


def _types(schema: Schema) -> Iterator[str]:
    if "type" in schema:
        yield schema["type"]
    for part in (*schema.get("anyOf", ()), *schema.get("prefixItems", ())):
        yield from _types(part)
    if isinstance(schema.get("items"), dict):
        yield from _types(schema["items"])


def bound(schema: Schema) -> str:
    """The values that a schema accepts, in words."""
    if "anyOf" in schema:
        return "; or ".join(bound(part) for part in schema["anyOf"] if part.get("type") != "null")
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return ", ".join(json.dumps(value) for value in schema["enum"])
    match schema.get("type"):
        case "boolean":
            return "true, false"
        case "integer":
            return f"whole, {_range(schema)}"
        case "number":
            return _range(schema)
        case "array":
            return _list(schema)
        case "object":
            return "table"
        case "string" if "x-names" in schema:
            return str(schema["x-names"])
        case "string":
            return f"text matching `{schema['pattern']}`" if "pattern" in schema else "text"
    return "any"


def _range(schema: Schema) -> str:
    least, above = schema.get("minimum"), schema.get("exclusiveMinimum")
    most, below = schema.get("maximum"), schema.get("exclusiveMaximum")
    if least is not None and most is not None:
        return f"{_number(least)} to {_number(most)}"
    words = [
        f"{sign} {_number(limit)}"
        for sign, limit in ((">=", least), (">", above), ("<=", most), ("<", below))
        if limit is not None
    ]
    return ", ".join(words) or "any number"


def _number(value: float) -> str:
    return f"{value:,.10g}" if abs(value) < 1e12 else f"{value:.4g}"


def _list(schema: Schema) -> str:
    if "prefixItems" in schema:
        bounds = [bound(part) for part in schema["prefixItems"]]
        each = f"each {bounds[0]}" if len(set(bounds)) == 1 else " | ".join(bounds)
        return f"[{len(bounds)} values], {each}"
    return f"list of ({bound(schema['items'])})"


def _single_lines(value: object) -> object:
    """A schema whose descriptions are single lines, because docstrings are wrapped as in the source."""
    if isinstance(value, dict):
        return {
            key: re.sub(r"\s+", " ", item) if key == "description" and isinstance(item, str) else _single_lines(item)
            for key, item in value.items()
        }
    return [_single_lines(item) for item in value] if isinstance(value, list) else value
