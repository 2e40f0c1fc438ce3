"""Reads a file that a scenario names, such as a map or buildings."""

from pathlib import Path
from typing import Final

from fanet_mw.errors import ConfigError

_MOST_BYTES: Final = 256 * 1024 * 1024


def content(path: Path, *, key: str) -> bytes:
    """The bytes of the file that this key of a scenario names; raises ConfigError if it cannot be read."""
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise ConfigError(f"{key}: {path} must be at most {_MOST_BYTES // 2**20} MB")
        return path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{key}: {path} cannot be read: {error.strerror}") from error
