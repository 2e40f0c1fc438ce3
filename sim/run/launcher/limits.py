"""Checks the limits of the machine (ulimit) that a run in real time needs, before anything is started.

A limit that is too low would otherwise show as a traceback in the middle of a run, about a pipe, a thread or a mapping.
"""

import os
import resource
from typing import Final

from fanet_mw.errors import ConfigError

_FILES: Final = 48
"""The number of files that the launcher has open, without those for its children (29 were measured)."""
_FILES_PER_PROCESS: Final = 3
"""The number of files that the launcher needs for each child: a sentinel, a pipe and a connection of the bus."""
_ADDRESS_SPACE_MIB: Final = 2048
"""The address space of each process; the launcher of 47 processes takes 1,440, mostly untouched memory."""


_MANY_PER_CORE: Final = 100
"""More UAVs for each core than this are beyond what was run in real time."""


def many(*, processes: int) -> str | None:
    """A sentence for those who start more processes than this machine is likely to carry; None if it is likely to."""
    cores = len(os.sched_getaffinity(0))
    if processes <= _MANY_PER_CORE * cores:
        return None
    return (
        f"{processes:,} processes will be started, one for each UAV, on {cores} cores; "
        "fanet simulate runs the same scenario in one, in virtual time"
    )


def prepare(*, processes: int) -> None:
    """Raise the soft limit of open files as far as needed; raises ConfigError when a hard limit is too low."""
    files = _FILES + _FILES_PER_PROCESS * processes
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < files:
        if hard != resource.RLIM_INFINITY and hard < files:
            raise ConfigError(
                f"{processes} processes need {files} open files in the launcher; the limit is {hard} (ulimit -n)"
            )
        resource.setrlimit(resource.RLIMIT_NOFILE, (files, hard))
    space, _ = resource.getrlimit(resource.RLIMIT_AS)
    if space != resource.RLIM_INFINITY and space < _ADDRESS_SPACE_MIB << 20:
        raise ConfigError(
            f"a process of the swarm needs {_ADDRESS_SPACE_MIB} MiB of address space; "
            f"the limit is {space >> 20} MiB (ulimit -v)"
        )
