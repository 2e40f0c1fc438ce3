"""What a user reads of a scenario that is not valid: a sentence for each mistake, with key, value and bound.

An unknown key is answered with the known key that is spelt most like it.
"""

import difflib
from typing import Any

from pydantic import BaseModel

from fanet_mw.scenario.model import Scenario


def sentence(item: dict[str, Any]) -> str:
    """One mistake as `key = value: bound`."""
    path = [str(part) for part in item["loc"] if not _is_branch(str(part))]
    key = ".".join(path)
    if item["type"] == "extra_forbidden":
        return f"{key}: unknown key{_suggestion(path)}"
    message = str(item["msg"]).removeprefix("Value error, ")
    if item["type"] == "value_error":
        return message
    return f"{key} = {item['input']!r}: {message[0].lower()}{message[1:]}"


def _is_branch(part: str) -> bool:
    """True for a part of a location that names the member of a union; pydantic adds it, and users do not know it."""
    return "[" in part or part in {"int", "float", "constrained-int", "literal"}


def _suggestion(path: list[str]) -> str:
    model: type[BaseModel] = Scenario
    for part in path[:-1]:
        field = model.model_fields.get(part)
        if field is None or not (isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel)):
            return ""
        model = field.annotation
    close = difflib.get_close_matches(path[-1], model.model_fields, n=1)
    known = ", ".join(sorted(model.model_fields))
    return f"; did you mean {close[0]}?" if close else f"; known keys: {known}"
