"""The key of a ground station's signatures, as people keep it in files."""

import hashlib
from pathlib import Path

import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.gateway.signing import read_key

RAW = bytes(range(32))
PASSPHRASE = b"a passphrase of 31 characters.."


@pytest.mark.parametrize(
    ("content", "key"),
    [
        (RAW, RAW),
        (RAW[:31] + b"\n", RAW[:31] + b"\n"),
        (RAW.hex().encode() + b"\r\n", RAW),
        (PASSPHRASE + b"\n", hashlib.sha256(PASSPHRASE).digest()),
        (PASSPHRASE, hashlib.sha256(PASSPHRASE).digest()),
        (b"\xef\xbb\xbf" + PASSPHRASE, hashlib.sha256(PASSPHRASE).digest()),
    ],
    ids=["bytes", "bytes with a line end", "hexadecimal", "31 characters and a line end", "31 characters", "a mark"],
)
def test_a_key_is_what_its_author_meant(tmp_path: Path, content: bytes, key: bytes) -> None:
    assert len(PASSPHRASE) == 31
    path = tmp_path / "key"
    path.write_bytes(content)
    assert read_key(path) == key


@pytest.mark.parametrize(
    ("path", "why"), [("/dev/zero", "not a regular file"), ("/", "not a regular"), ("/no", "No s")]
)
def test_what_is_no_file_of_a_key_is_refused(path: str, why: str) -> None:
    with pytest.raises(ConfigError, match=f"--mavlink-key {path}: .*{why}"):
        read_key(Path(path))
