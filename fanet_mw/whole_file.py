"""Files that are whole: items that end with the last one that fits, or one content that replaces another."""

import contextlib
import errno
import fcntl
import hashlib
import os
from collections.abc import Iterable, Iterator
from itertools import accumulate
from pathlib import Path
from typing import BinaryIO, Final

from fanet_mw.errors import ConfigError

_BATCH_BYTES: Final = 1 << 18


class Written:
    """The size and the digest of what a file holds."""

    def __init__(self) -> None:
        self.bytes = 0
        self._digest = hashlib.sha256()

    def add(self, data: bytes | memoryview) -> None:
        self.bytes += len(data)
        self._digest.update(data)

    @property
    def sha256(self) -> str:
        return self._digest.hexdigest()


def write_items(path: Path, items: Iterable[bytes], held: Written | None = None) -> None:
    """Write items one after another; `held` takes in what the file holds: as many as fit. Raises OSError."""
    held = held or Written()
    with path.open("wb", buffering=0) as file:
        for batch in batches(items, least_bytes=_BATCH_BYTES):
            data = b"".join(batch)
            written = 0
            try:
                while written < len(data):
                    written += os.write(file.fileno(), data[written:])
            except OSError:
                ends = accumulate(map(len, batch))
                kept = max((end for end in ends if end <= written), default=0)
                os.ftruncate(file.fileno(), held.bytes + kept)
                held.add(memoryview(data)[:kept])
                raise
            held.add(data)


def keep_alone(file: int, busy: str) -> None:
    """Lock an open file or folder as long as it is open, unless its file system locks nothing; if somebody else has it,
    raise ConfigError, which says `busy`.
    """
    with contextlib.suppress(OSError):
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise ConfigError(busy) from error


def require_in_place(file: BinaryIO, path: Path) -> None:
    """Raise OSError if an open file was removed or replaced since: what is written to it then is nowhere."""
    if not os.path.samestat(os.fstat(file.fileno()), path.stat()):
        raise FileNotFoundError(errno.ENOENT, "another file has taken its place")


@contextlib.contextmanager
def writing(what: object) -> Iterator[None]:
    """Turn what hinders the writing of a file or a folder, which messages call `what`, into a ConfigError."""
    try:
        yield
    except OSError as error:
        why = error.strerror
        if isinstance(error, FileExistsError) and (link := Path(error.filename)).is_symlink() and not link.exists():
            why = f"a link to {link.readlink()}, which does not exist"
        raise ConfigError(f"{what}: cannot be written: {why}") from error


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A new file in place of one of this name once it is whole, never through a link; raises OSError."""
    if path.exists() and not (path.is_file() or path.is_symlink()):
        raise OSError(errno.EINVAL, "not a regular file")
    fresh = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        fresh.unlink(missing_ok=True)
        with fresh.open("xb") as file:
            yield file
        fresh.replace(path)
    except BaseException:
        fresh.unlink(missing_ok=True)
        raise


def replace_file(path: Path, data: bytes) -> None:
    """Put a file with this content in the place of a file, or of a link, of this name; raises OSError."""
    with replacing(path) as file:
        file.write(data)


def require_folder(path: Path) -> None:
    """Make a folder if there is none; raises NotADirectoryError for a link to one, which might be anywhere."""
    with contextlib.suppress(FileExistsError):
        path.mkdir()
    if path.is_symlink() or not path.is_dir():
        raise NotADirectoryError(20, f"{path.name} is no folder of its own", str(path))


def batches(items: Iterable[bytes], *, least_bytes: int) -> Iterator[list[bytes]]:
    """The items in lists that hold at least so many bytes each; only the last one may hold less."""
    batch: list[bytes] = []
    size = 0
    for item in items:
        batch.append(item)
        size += len(item)
        if size >= least_bytes:
            yield batch
            batch, size = [], 0
    if batch:
        yield batch
