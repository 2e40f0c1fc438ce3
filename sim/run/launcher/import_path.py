"""Keeps files of the working folder, such as a numpy of the user's, out of the way of processes that Python starts.

multiprocessing starts them by `python -c`, which looks there first for whatever is imported.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

_VARIABLE: Final = "PYTHONSAFEPATH"
_OURS: Final = "fanet"


@contextmanager
def without_working_folder() -> Iterator[None]:
    """Python processes that are started meanwhile do not import from the working folder."""
    before = os.environ.setdefault(_VARIABLE, _OURS)
    try:
        yield
    finally:
        if before == _OURS:
            os.environ.pop(_VARIABLE, None)


def restore() -> None:
    """In such a process: let those that it starts in its turn import as always."""
    if os.environ.get(_VARIABLE) == _OURS:
        del os.environ[_VARIABLE]
