"""The files that a scenario names: the digests of their contents, and the place on earth of a map.

Whoever reads a scenario reads its files once. Their digests become part of it, so that two runs with different maps
are different runs, wherever the files lie.
"""

import hashlib
import stat
from functools import lru_cache
from pathlib import Path
from typing import Final

from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import read_regular
from fanet_mw.scenario import ascii_grid, outlines

MOST_BYTES: Final = 256 * 1024 * 1024
_DIGITS: Final = 16
_HEADER_BYTES: Final = 4096


def digest_of_bytes(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:_DIGITS]


def digest_of(path: str) -> str:
    """The digest of a file's content; empty if it cannot be read, which whoever needs it will say."""
    try:
        found = Path(path).stat()
        return _digest(path, found.st_size, found.st_mtime_ns, found.st_ino) if stat.S_ISREG(found.st_mode) else ""
    except (OSError, ValueError):  # ValueError: a path with a NUL
        return ""


def middle_deg(*, heightmap: str, buildings: str) -> tuple[float, float] | None:
    """Latitude and longitude of the middle of the buildings or else of the heights; None if the files do not say."""
    return _middle_of_buildings(buildings, digest_of(buildings)) or _middle_of_heights(heightmap, digest_of(heightmap))


@lru_cache(maxsize=64)
def _digest(path: str, size: int, _changed_ns: int, _file: int) -> str:
    return digest_of_bytes(Path(path).read_bytes()) if size <= MOST_BYTES else ""


@lru_cache(maxsize=8)
def _middle_of_buildings(path: str, digest: str) -> tuple[float, float] | None:
    try:
        return outlines.parse(Path(path).read_bytes()).middle_deg if digest else None
    except (OSError, ValueError, RecursionError):
        return None  # whoever builds the world says what is wrong with the file


@lru_cache(maxsize=8)
def _middle_of_heights(path: str, digest: str) -> tuple[float, float] | None:
    if not digest:
        return None  # a pipe would be waited for
    try:
        with Path(path).open("rb") as file:
            return ascii_grid.parse(file.read(_HEADER_BYTES)).place_deg
    except (OSError, ValueError):
        return None


def content(path: Path, *, key: str, digest: str = "") -> bytes:
    """The bytes of the file that a key names; raises ConfigError if it cannot be read, or has another digest."""
    try:
        data = read_regular(path, most_bytes=MOST_BYTES)
    except ConfigError as error:
        raise ConfigError(f"{key}: {error}") from error
    if digest and digest != digest_of_bytes(data):
        raise ConfigError(f"{key}: {path} has changed since the scenario was read")
    return data
