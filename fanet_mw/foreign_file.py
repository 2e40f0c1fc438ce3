"""Reads files that somebody else may have made: regular ones, of bounded size, and plain values of bounded depth.

A pipe would let the reader wait for ever, a device has no end, and nested values end in Python's recursion. What a
folder of somebody else holds is opened without following links, so that nothing outside of it is read. All that is
wrong is a ConfigError of one line.
"""

import json
import math
import os
import stat
import tomllib
from pathlib import Path
from typing import Any, BinaryIO, Final

from fanet_mw.errors import ConfigError

MOST_TEXT_BYTES: Final = 1 << 26
"""The greatest size of a file of text that people write, such as a scenario with the packets of an hour."""
_DEEPEST: Final = 16
"""The greatest depth of tables within tables."""


def open_regular(path: Path, *, what: str = "", most_bytes: int | None = None, follow: bool = True) -> BinaryIO:
    """Open a regular file of at most `most_bytes`; raises ConfigError, which calls it `what`, for anything else."""
    what = what or str(path)
    link = 0 if follow else os.O_NOFOLLOW
    try:
        status = path.stat(follow_symlinks=follow)
        if not stat.S_ISREG(status.st_mode):
            raise ConfigError(f"{what}: cannot be read: {_kind(status.st_mode)}, not a regular file")
        file = os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | link), "rb")
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(f"{what}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    size = os.fstat(file.fileno()).st_size
    if most_bytes is not None and size > most_bytes:
        file.close()
        raise ConfigError(f"{what}: cannot be read: {size} bytes, at most {most_bytes}")
    return file


def read_regular(path: Path, *, what: str = "", most_bytes: int = MOST_TEXT_BYTES, follow: bool = True) -> bytes:
    """The content of a regular file; raises ConfigError as `open_regular` does."""
    with open_regular(path, what=what, most_bytes=most_bytes, follow=follow) as file:
        try:
            return file.read(most_bytes)
        except OSError as error:
            raise ConfigError(f"{what or path}: cannot be read: {error.strerror}") from error


def toml_of(text: str | bytes, *, source: str) -> dict[str, Any]:
    """The plain values of a TOML text; `source` is what messages call it. Raises ConfigError."""
    decoded = _decoded(text, source) if isinstance(text, bytes) else text
    try:
        tree = tomllib.loads(decoded)
    except (ValueError, RecursionError) as error:  # ValueError: wrong TOML, or a number of thousands of digits
        raise ConfigError(f"{source}: not valid TOML: {_cause(error)}") from error
    require_plain(tree, source=source)
    return tree


def json_of(text: bytes, *, source: str) -> Any:  # noqa: ANN401  (whatever JSON holds)
    """The plain values of a JSON text; raises ConfigError, also for numbers that are none."""
    try:
        value = json.loads(_decoded(text, source))
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{source}: not valid JSON: {_cause(error)}") from error
    require_plain(value, source=source, finite=True)
    return value


_LONGEST_NAME: Final = 64
"""The part of a key's name that an error repeats."""


def require_plain(value: object, *, source: str, finite: bool = False, deepest: int = _DEEPEST) -> None:
    """Raises ConfigError for values nested deeply, integers beyond 64 bits and, with `finite`, infinite numbers."""
    level: list[tuple[str, object]] = [("", value)]
    for _ in range(deepest + 1):
        inner: list[tuple[str, object]] = []
        for name, item in level:
            if isinstance(item, dict):
                inner += ((f"{name}.{str(key)[:_LONGEST_NAME]}".lstrip("."), held) for key, held in item.items())
            elif isinstance(item, list | tuple):
                inner += ((name, held) for held in item)
            elif isinstance(item, int):
                if not -(2**63) <= item < 2**63:
                    at = f"{name} " if name else ""
                    raise ConfigError(f"{source}: {at}holds an integer of {item.bit_length()} bits, at most 64")
            elif finite and isinstance(item, float) and not math.isfinite(item):
                raise ConfigError(f"{source}: {name} holds the number {item}, which must be finite")
        if not inner:
            return
        level = inner
    raise ConfigError(f"{source}: holds values nested more than {deepest} deep")


def _decoded(data: bytes, source: str) -> str:
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{source}: cannot be read: {error}") from error


def _cause(error: Exception) -> str:
    if isinstance(error, RecursionError):
        return f"values nested more than {_DEEPEST} deep"
    return "a number has too many digits" if "set_int_max_str_digits" in str(error) else str(error)


def _kind(mode: int) -> str:
    kinds = {stat.S_IFIFO: "a pipe", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device", stat.S_IFSOCK: "a socket",
             stat.S_IFLNK: "a link", stat.S_IFDIR: "a folder"}  # fmt: skip
    return kinds.get(stat.S_IFMT(mode), "something else")
