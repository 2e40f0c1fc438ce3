"""Compilation by numba when it is installed; otherwise the same source runs uncompiled (for debugging and coverage).

FANET_NO_NUMBA=1 in the environment leaves functions uncompiled. The variable is read here, once, and nowhere else.

numba caches machine code per function and looks only at that function's own file: after a change to
`frame_exchange.py` it would go on running the old code inlined into `kernel.py`. So each state of all compiled sources
has a cache directory of its own.
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
    """A hash of the sources that hold compiled functions, the constants they use and the way they are compiled."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        source = path.read_bytes()
        if b"from emulator.kernel.jit import" in source or path.name in ("state.py", "jit.py"):
            digest.update(source)
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """The directory in which the machine code of these sources is cached."""
    import numba

    folder = Path(__file__).parents[1]
    return Path(numba.config.CACHE_DIR or folder / "__pycache__") / f"kernel-{_fingerprint(folder)}"


def _as_far_as_the_disk_goes(save: Callable[..., None]) -> Callable[..., None]:
    """`save`, except that a full disk is no error: the code is used, and the next run compiles it again."""

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
        numba.config.CACHE_DIR = ours  # numba reads this when it decorates a function; others rely on it: put it back
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
"""The decorator of functions that make arrays of the memory to which they are given pointers."""
COMPILED = jit is not _identity
"""True when the kernel runs as machine code."""
