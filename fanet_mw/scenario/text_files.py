"""Text files as people's programs write them: in UTF-8 or, where a byte-order mark says so, in UTF-16 or UTF-32."""

from pathlib import Path
from typing import Final

from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import read_regular

_MARKS: Final = (
    (b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe\0\0", "utf-32"), (b"\0\0\xfe\xff", "utf-32"), (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)  # fmt: skip
_NO_TEXT: Final = (
    (b"PK\x03\x04", "a ZIP archive: unpack it"), (b"\x1f\x8b", "compressed by gzip: unpack it"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive: unpack it"), (b"BZh", "compressed by bzip2: unpack it"),
    (b"SQLite format 3", "a GeoPackage or another SQLite database: export it, for example by ogr2ogr"),
    (b"\0\0\x27\x0a", "a shapefile: export it, for example by ogr2ogr"),
    (b"<", "XML or HTML: export it, OpenStreetMap's for example by osmtogeojson"),
)  # fmt: skip
"""How files of other kinds begin, and what each is."""
_SPREADSHEET: Final = (b"[Content_Types].xml", b"vnd.oasis.opendocument")
_CONTROLS: Final = frozenset(range(32)) - frozenset(b"\t\n\r\f\x1a")
"""Bytes that no text holds."""


def decoded(data: bytes, *, otherwise: str = "utf-8") -> str:
    """The text of a file; raises ValueError."""
    if data.startswith(b"PK") and any(mark in data[:128] for mark in _SPREADSHEET):
        raise ValueError("it is a spreadsheet: save it as CSV")
    for start, what in _NO_TEXT:
        if data[:64].lstrip(b"\xef\xbb\xbf \t\r\n").startswith(start):
            raise ValueError(f"it is {what}")
    return data.decode(next((encoding for mark, encoding in _MARKS if data.startswith(mark)), otherwise))


def read_text(path: Path, *, what: str, latin: bool = False) -> str:
    """The text of a file; raises ConfigError, which calls it `what`. `latin`: it may be in Latin-1."""
    data = read_regular(path, what=what)
    try:
        return decoded(data)
    except UnicodeError as error:
        if latin and not _CONTROLS.intersection(data):
            return data.decode("latin-1")
        raise ConfigError(f"{what}: is no text in UTF-8: {error}") from error
    except ValueError as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(f"{what}: {error}") from error
