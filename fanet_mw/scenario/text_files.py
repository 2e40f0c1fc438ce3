"""Text files as people's programs write them: in UTF-8 or, where a byte-order mark says so, in UTF-16."""

from pathlib import Path
from typing import Final

from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import read_regular

_MARKS: Final = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))


def decoded(data: bytes, *, otherwise: str = "utf-8") -> str:
    """The text of a file; raises UnicodeDecodeError."""
    return data.decode(next((encoding for mark, encoding in _MARKS if data.startswith(mark)), otherwise))


def read_text(path: Path, *, what: str) -> str:
    """The text of a file; raises ConfigError, which calls it `what`."""
    try:
        return decoded(read_regular(path, what=what))
    except UnicodeError as error:
        raise ConfigError(f"{what}: is no text in UTF-8: {error}") from error
