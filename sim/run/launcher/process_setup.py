"""What a process that Python starts (a swarm's process, a sweep's worker) needs: it ends with its parent, however that
ends, and files of the working folder, such as a numpy of the user's, are not in its way.

multiprocessing starts processes by `python -c`, which looks there first for whatever is imported.
"""

import ctypes
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

_VARIABLE: Final = "PYTHONSAFEPATH"
_OURS: Final = "fanet"
_PR_SET_PDEATHSIG: Final = 1


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


def be_killed_with_parent() -> None:
    """Let Linux kill this process when the thread that forked it ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
