"""Says before the large imports how much address space a command needs, where a limit (`ulimit -v`) leaves less.

Below these sizes numpy, LLVM and pybullet end a process with a page of traceback, or without a word.
"""

import mmap
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from fanet_mw.errors import ConfigError

_STATM: Final = Path("/proc/self/statm")
_MB: Final = 1 << 20
_NEEDED_MB: Final = {
    "simulate": 560, "sweep": 560, "plan": 560, "emulator": 560, "world": 560, "agent": 560, "router": 560,
    "launch": 760, "replay": 760, "log export": 760, "report": 860, "figures": 860,
    "record": 560, "view": 560, "top": 560, "inspect": 560, "topic": 420, "gateway": 420, "links": 420, "air": 420,
    "order": 420, "autopilots": 420, "keys": 420,
}  # fmt: skip
"""What commands need on two cores, measured as VmPeak (457, 590 and 739 MB) with a fifth more."""
_COMPILING_MB: Final = 760
"""What compiling the kernel needs (604 MB)."""
_CORE_MB: Final = 40
"""What a further core takes: the buffer and the stack of a thread of numpy's algebra."""


def require_for(words: Sequence[str]) -> None:
    """Raises ConfigError if there is too little for the command of these words."""
    command = " ".join(words[: 2 if words[:1] == ["log"] else 1])
    need_mb = _NEEDED_MB.get(command, 0)
    if need_mb and "--report" in words:
        need_mb = max(need_mb, _NEEDED_MB["report"])
    if need_mb and not {"--help", "-h"} & {*words}:
        require(need_mb, what=f"fanet {command}")


def compile_kernel(tell: Callable[[str], None]) -> None:
    """Compile the emulator's kernel, if that must be done, before runs begin; raises ConfigError."""
    from emulator.compile_kernel import COMPILING_NOTICE, must_compile, warm_up

    if must_compile():
        require(_COMPILING_MB, what="compiling the kernel")
        tell(COMPILING_NOTICE)
        warm_up()


def require(need_mb: int, *, what: str) -> None:
    """Raises ConfigError if this process cannot have so much address space."""
    need_mb += _CORE_MB * max(0, (os.cpu_count() or 1) - 2)
    used = int(_STATM.read_text("ascii").split()[0]) * mmap.PAGESIZE if _STATM.exists() else 0
    length = max(mmap.PAGESIZE, need_mb * _MB - used)
    try:
        mmap.mmap(-1, length, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, prot=mmap.PROT_READ).close()
    except OSError as error:
        raise ConfigError(f"{what}: needs {need_mb} MB of address space, and may have less (ulimit -v)") from error
