"""What a run in real time needs of the machine's limits, looked at before anything is started.

A limit that is too low would else show as a traceback somewhere in the middle: of a pipe, a thread or a mapping.
"""

import resource
from typing import Final

from fanet_mw.errors import ConfigError

_FILES: Final = 48
"""Files that the launcher has open besides those of its children (29 measured)."""
_FILES_PER_PROCESS: Final = 3
"""A sentinel, a pipe and a connection of the bus."""
_ADDRESS_SPACE_MIB: Final = 2048
"""Of each process; the launcher of 47 processes takes 1,440, mostly stacks and arenas that it never touches."""


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
