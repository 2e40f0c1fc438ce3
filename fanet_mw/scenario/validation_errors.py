"""What a user reads of a scenario that is not valid: a sentence for each mistake, with key, value and bound.

An unknown key is answered with the known key that is spelt most like it.
"""

import difflib
from collections.abc import Iterator, Mapping
from typing import Any, Final

from pydantic import BaseModel, ValidationError

from fanet_mw.scenario.model import Scenario
from fanet_mw.scenario.tables.sections import NO_TRUTH

_MOST_UNKNOWN: Final = 8
"""More unknown keys than this are named together, by the first ones."""
_LONGEST_VALUE: Final = 80
_REMOVED: Final = {
    "clusters.relay = 'claimed'": 'removed; take routing.protocol = "rounds" for turns without a leader',
    **{
        f"clusters.relay = '{rule}'": 'removed; take "counter" for fewer relays, or routing.protocol = "rounds"'
        for rule in ("gossip", "heads", "cds", "mpr")
    },
    **dict.fromkeys(
        ("world.heightmap_white_m", "world.heightmap_pixel_m"), "removed with pictures as heights; take a GeoTIFF"
    ),
    "clusters.gossip_degree": 'removed with clusters.relay = "gossip"; take "counter"',
    "mission.avoid_by": "removed: UAVs avoid others by hellos, and by a radar where they have one",
    "mission.report_priority": "removed: survivor reports have the priority report",
    "mission.coverage_map": "removed: as much was searched without it; free UAVs follow their place in the formation",
    "clusters.slots": 'removed with clusters.relay = "claimed"; take routing.protocol = "rounds"',
}
"""Keys and values that older scenarios may have, and what to take instead."""
_REMOVED_DEFAULTS: Final[Mapping[str, Mapping[str, Any]]] = {
    "mission": {"report_priority": "report", "coverage_map": False, "avoid_by": ["hellos", "radar"]},
    "world": {"heightmap_white_m": 100.0, "heightmap_pixel_m": 10.0},
    "clusters": {"slots": 0, "gossip_degree": 6.0},
}
"""Removed keys with the value that did nothing, as every result folder of that time has them."""


def without_removed_defaults(tree: Mapping[str, Any]) -> dict[str, Any]:
    """A scenario that a run has written, without removed keys that had no effect in it."""
    return {
        name: {key: value for key, value in table.items() if key not in gone or value != gone[key]}
        if isinstance(table, Mapping) and (gone := _REMOVED_DEFAULTS.get(name))
        else table
        for name, table in tree.items()
    }


def sentences(error: ValidationError) -> list[str]:
    """All mistakes of a scenario, each once."""
    items = error.errors(include_url=False)
    unknown = [item for item in items if item["type"] == "extra_forbidden"]
    return list(dict.fromkeys(_sentences([dict(item) for item in items], many=len(unknown) > _MOST_UNKNOWN)))


def _sentences(items: list[dict[str, Any]], *, many: bool) -> Iterator[str]:
    unknown = [_key(item) for item in items if many and item["type"] == "extra_forbidden"]
    if unknown:
        yield f"{', '.join(unknown[:_MOST_UNKNOWN])} and {len(unknown) - _MOST_UNKNOWN} more: unknown keys"
    yield from (sentence(item) for item in items if not (many and item["type"] == "extra_forbidden"))


def sentence(item: dict[str, Any]) -> str:
    """One mistake as `key = value: bound`."""
    path, key = _path(item), _key(item)
    if item["type"] == "extra_forbidden":
        return f"{key}: {_REMOVED.get(key) or f'unknown key{_suggestion(path)}'}"
    message = str(item["msg"]).removeprefix("Value error, ")
    if item["type"] == NO_TRUTH:
        return f"{key}.{message}" if item["loc"] else message
    if item["type"] == "value_error":
        return message
    value = repr(item["input"])
    shown = value if len(value) <= _LONGEST_VALUE else f"{value[:_LONGEST_VALUE]}..."
    said = f"{key} = {shown}"
    return f"{said}: {_REMOVED.get(said) or message[0].lower() + message[1:]}"


def _path(item: dict[str, Any]) -> list[str]:
    """The keys on the way to a mistake; an unknown key is kept however it is spelt."""
    if not item["loc"]:
        return []
    *path, last = map(str, item["loc"])
    kept = item["type"] == "extra_forbidden" or not _is_branch(last)
    return _as_in_a_file([*(part for part in path if not _is_branch(part)), *([last] if kept else [])])


def _as_in_a_file(path: list[str]) -> list[str]:
    """Further classes of traffic, and faults of a kind, as a file and `--set` number them."""
    match path:
        case ["further_traffic", index, *rest]:
            return ["traffic", str(int(index) + 1), *rest]
        case ["faults", index, _kind, *rest]:
            return ["faults", index, *rest]
    return path


def _key(item: dict[str, Any]) -> str:
    """The dotted key of a mistake; a part that could not stand so in a file is quoted, and shortened."""
    parts = [part if part.replace("-", "_").isidentifier() or part.isdecimal() else repr(part) for part in _path(item)]
    return ".".join(part if len(part) <= _LONGEST_VALUE else f"{part[:_LONGEST_VALUE]}..." for part in parts)


def _is_branch(part: str) -> bool:
    """True for a part of a location that names the member of a union; pydantic adds it, and users do not know it."""
    return "[" in part or part in {"int", "float", "constrained-int", "constrained-float", "literal"}


def _suggestion(path: list[str]) -> str:
    model: type[BaseModel] = Scenario
    for part in path[:-1]:
        if part.isdecimal():
            continue
        field = model.model_fields.get(part)
        if field is None or not (isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel)):
            return ""
        model = field.annotation
    close = difflib.get_close_matches(path[-1], model.model_fields, n=1)
    known = ", ".join(sorted(model.model_fields))
    return f"; did you mean {close[0]}?" if close else f"; known keys: {known}"
