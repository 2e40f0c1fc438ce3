"""Converts values to TOML text and back, as in `--set KEY=VALUE`; `toml_value` is the inverse of `one_value`."""

import json
from collections.abc import Iterator, Mapping

from fanet_mw.errors import ConfigError
from fanet_mw.scenario.config import one_value

_OPENING = "[{"
_CLOSING = "]}"


def toml_value(value: object) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return repr(value)
        case str():
            # TOML requires DEL to be escaped, JSON does not
            return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
        case list() | tuple():
            return f"[{', '.join(toml_value(item) for item in value)}]"
        case Mapping():
            return f"{{{', '.join(f'{key} = {toml_value(item)}' for key, item in value.items())}}}"
        case _:
            raise ConfigError(f"{value!r} is no value of a scenario key")


def axis(text: str) -> tuple[str, list[object]]:
    """`KEY=A,B,C` as a key and its values; commas within brackets or quotes belong to a value."""
    key, equals, values = text.partition("=")
    if not equals or not key.strip() or not values.strip():
        raise ConfigError(f"--set {text!r}: must be KEY=VALUE or KEY=VALUE,VALUE,..., for example nodes.count=10,20,40")
    return key.strip(), [one_value(part.strip()) for part in _parts(values)]


def _parts(text: str) -> Iterator[str]:
    depth, quote, part = 0, "", ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        depth += (letter in _OPENING) - (letter in _CLOSING) if not quote else 0
        if letter == "," and not quote and depth == 0:
            yield part
            part = ""
        else:
            part += letter
    yield part
