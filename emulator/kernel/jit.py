"""numba when it is installed, the same source uncompiled otherwise (slow: for debugging and coverage).

FANET_NO_NUMBA=1 in the environment leaves functions uncompiled. Read here, once, and nowhere else.

numba keeps machine code per function and looks only at that function's own file: after a change to `dcf.py` it would
go on running the old code inlined into `kernel.py`. So the cache has a directory per state of all compiled sources.

Functions that make no arrays, all but those of `entry.py`, are compiled without numba's counts of references to arrays
(`_nrt`): these are atomic, a pair per array and call that is not inlined, and took half of the kernel's time. Of what
was left a third was calls that handed a dozen arrays on, each in nine parts: so all are inlined.
"""

import contextlib
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])


def _identity(function: F) -> F:
    return function


def _fingerprint(folder: Path) -> str:
    """What the sources with compiled functions say, the constants they use and how they are compiled, in short."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        source = path.read_bytes()
        if b"from emulator.kernel.jit import" in source or path.name in ("state.py", "jit.py"):
            digest.update(source)
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Where machine code of these sources is kept."""
    import numba

    folder = Path(__file__).parents[1]
    return Path(numba.config.CACHE_DIR or folder / "__pycache__") / f"kernel-{_fingerprint(folder)}"


def _as_far_as_the_disk_goes(save: Callable[..., None]) -> Callable[..., None]:
    """Machine code that a full disk cannot keep is used all the same, and compiled again in the next process."""

    def saved(*arguments: object) -> None:
        with contextlib.suppress(OSError):
            save(*arguments)

    return saved


def _decorator(*, counted: bool) -> Callable[[F], F]:
    if os.environ.get("FANET_NO_NUMBA"):
        return _identity
    try:
        import numba
    except ImportError:
        return _identity
    everyone = numba.config.CACHE_DIR
    ours = str(cache_folder())

    def compiled(function: F) -> F:
        numba.config.CACHE_DIR = ours  # read when a function is decorated, and by others too: put it back
        try:
            compile_ = numba.njit(cache=True, error_model="numpy", _nrt=counted, forceinline=not counted)
            dispatcher = compile_(function)
        finally:
            numba.config.CACHE_DIR = everyone
        cache = dispatcher._cache  # noqa: SLF001  (numba has no option for this)
        cache.save_overload = _as_far_as_the_disk_goes(cache.save_overload)
        return cast("F", dispatcher)

    return compiled


jit = _decorator(counted=False)
jit_views = _decorator(counted=True)
"""For functions that make arrays of memory they are pointed to."""
COMPILED = jit is not _identity
"""Whether the kernel is machine code."""
