"""A file of whole items: when the disk is full, the file ends with the last item that fits."""

import os
from collections.abc import Iterable, Iterator
from itertools import accumulate
from pathlib import Path
from typing import Final

_BATCH_BYTES: Final = 1 << 18


def write_items(path: Path, items: Iterable[bytes]) -> int:
    """Write items one after another; returns the number of bytes written.

    Raises OSError when the file cannot be opened or written; it then holds as many whole items as fit.
    """
    with path.open("wb", buffering=0) as file:
        done = 0
        for batch in batches(items, least_bytes=_BATCH_BYTES):
            data = b"".join(batch)
            written = 0
            try:
                while written < len(data):
                    written += os.write(file.fileno(), data[written:])
            except OSError:
                ends = accumulate(map(len, batch))
                kept = max((end for end in ends if end <= written), default=0)
                os.ftruncate(file.fileno(), done + kept)
                raise
            done += written
    return done


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
