"""Reads a file that a scenario names, such as a map or buildings."""

from pathlib import Path

from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import read_regular
from fanet_mw.scenario.named_files import MOST_BYTES, digest_of_bytes


def content(path: Path, *, key: str, digest: str = "") -> bytes:
    """The bytes of the file that a key names; raises ConfigError if it cannot be read, or has another digest."""
    try:
        data = read_regular(path, most_bytes=MOST_BYTES)
    except ConfigError as error:
        raise ConfigError(f"{key}: {error}") from error
    if digest and digest != digest_of_bytes(data):
        raise ConfigError(f"{key}: {path} has changed since the scenario was read")
    return data
