"""Sets the name under which `ps`, `top` and `pgrep` show a process; otherwise all children would show that of the fork
server.

It works on Linux only. Elsewhere, and if /proc does not tell where the command line is, nothing happens.
"""

import ctypes
import sys
from pathlib import Path
from typing import Final

_PR_SET_NAME: Final = 15
_NAME_BYTES: Final = 15
_ARG_START, _ARG_END = 48 - 3, 49 - 3
"""The indices of fields of /proc/PID/stat (proc_pid_stat(5)), counted from the field after the command's closing
parenthesis."""


def entitle(name: str, title: str) -> None:
    """Name this process `name` (its first 15 characters), and make its command line `title`, as far
    as there is room.
    """
    if sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode()[:_NAME_BYTES], 0, 0, 0)
    fields = Path("/proc/self/stat").read_text(encoding="latin-1").rpartition(")")[2].split()
    start, end = int(fields[_ARG_START]), int(fields[_ARG_END])
    if start:  # the last byte stays zero; otherwise the kernel would add the environment to the command line
        ctypes.memmove(start, title.encode()[: end - start - 1].ljust(end - start, b"\0"), end - start)
