"""The clocks of a machine, and an identity of the machine, for everything that measures real time.

Unix time can be stepped. Instants that must survive that are told in monotonic time to processes of the same machine,
which all read the same, and in unix time only to others.
"""

import hashlib
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

_BOOT: Final = Path("/proc/sys/kernel/random/boot_id")
_TIME_NAMESPACE: Final = Path("/proc/self/ns/time")
"""A container may have a monotonic clock of its own, which this file identifies (time_namespaces(7))."""


class Timebase(NamedTuple):
    """The two clocks that a process reads."""

    unix_ns: Callable[[], int]
    mono_ns: Callable[[], int]
    machine: int
    """A number that is the same for all processes that read the same monotonic clock; 0 if it is not known."""


def _machine() -> int:
    try:
        known = _BOOT.read_text(encoding="ascii").strip()
        if _TIME_NAMESPACE.exists():
            known += str(os.readlink(_TIME_NAMESPACE))  # noqa: PTH115  (the link names no file)
    except OSError:
        return 0
    return int.from_bytes(hashlib.sha256(known.encode()).digest()[:8], "little")


THIS_MACHINE: Final = Timebase(time.time_ns, time.monotonic_ns, _machine())
