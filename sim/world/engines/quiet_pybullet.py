"""pybullet, imported in silence: it writes when it was built to standard error, in the middle of what others write."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

_STDERR = 2


@contextmanager
def _silence() -> Iterator[None]:
    """Send what C code writes to standard error nowhere."""
    try:
        kept = os.dup(_STDERR)
    except OSError:  # it is closed: nothing to silence
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, _STDERR)
    try:
        yield
    finally:
        os.dup2(kept, _STDERR)
        os.close(kept)
        os.close(nowhere)


with _silence():
    import pybullet

__all__ = ["pybullet"]
