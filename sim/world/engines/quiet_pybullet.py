"""Imports pybullet silently; it would otherwise print its build time on standard error, between the
output of others.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager

_STDERR = 2


@contextmanager
def _silence() -> Iterator[None]:
    """Discard what C code writes to standard error."""
    try:
        kept = os.dup(_STDERR)
    except OSError:  # standard error is closed
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
