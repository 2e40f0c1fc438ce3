"""Reads a file that a scenario names, such as a map or buildings."""

from pathlib import Path

from fanet_mw.errors import ConfigError
from fanet_mw.scenario.named_files import MOST_BYTES, digest_of_bytes


def content(path: Path, *, key: str, digest: str = "") -> bytes:
    """The bytes of the file that this key of a scenario names; raises ConfigError if it cannot be read, or is not the
    one with this digest.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ConfigError(f"{key}: {path} must be at most {MOST_BYTES // 2**20} MB")
        data = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{key}: {path} cannot be read: {error.strerror}") from error
    if digest and digest != digest_of_bytes(data):
        raise ConfigError(f"{key}: {path} has changed since the scenario was read")
    return data
