"""Asks Linux to kill a child (a swarm's process, a sweep's worker) when its parent ends, however that ends."""

import ctypes
import signal
import sys
from typing import Final

_PR_SET_PDEATHSIG: Final = 1


def be_killed_with_parent() -> None:
    """Let Linux kill this process when the thread that forked it ends; on other systems nothing happens."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
