"""A child process asks Linux to kill it when its parent process ends, however the parent ends.

The parent of a swarm's process is the fork server, which in turn ends with the launcher; the parent of a sweep's worker
is the process of the sweep.
"""

import ctypes
import signal
import sys
from typing import Final

_PR_SET_PDEATHSIG: Final = 1


def be_killed_with_parent() -> None:
    """Let Linux kill this process when the thread that forked it ends; on other systems nothing happens."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
