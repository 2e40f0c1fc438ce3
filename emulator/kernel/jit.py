"""Compilation by numba when it is installed; otherwise the same source runs uncompiled (for debugging and coverage).

FANET_NO_NUMBA=1 in the environment leaves functions uncompiled, as numba's own NUMBA_DISABLE_JIT=1 does. The variable
is read here, once, and nowhere else.

numba caches machine code per function and looks only at that function's own file: after a change to
`frame_exchange.py` it would go on running the old code inlined into `kernel.py`. So each state of all compiled sources
has a cache directory of its own.
"""

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from fanet_mw.errors import HostError

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


@cache
def cache_folder() -> Path | None:
    """Where these sources' machine code is cached: beside them, in the user's cache folder, or in that for temporary
    files; None if nowhere. numba itself would go on with code of older sources in the user's folder.
    """
    import numba

    sources = Path(__file__).parents[1]
    places = [Path(numba.config.CACHE_DIR)] if numba.config.CACHE_DIR else [sources / "__pycache__", *_of_user()]
    return first_writable([place / f"kernel-{_fingerprint(sources)}" for place in places])


def _of_user() -> Iterator[Path]:
    with contextlib.suppress(RuntimeError):  # without HOME, and without an entry among the users
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "fanet-mw"
    shared = Path(tempfile.gettempdir()) / f"fanet-mw-{os.getuid()}"
    with contextlib.suppress(OSError):
        shared.mkdir(mode=0o700, exist_ok=True)
        if shared.lstat().st_uid == os.getuid():  # what is found there is run
            yield shared


def first_writable(folders: Iterable[Path]) -> Path | None:
    for folder in folders:
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
    return None


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
    except ModuleNotFoundError:
        return _identity
    except (ImportError, ValueError) as error:  # without it, a run would take a hundred times as long
        raise HostError(
            f"numba is installed and cannot be imported: {error}; it reads the variables NUMBA_* of the environment; "
            "FANET_NO_NUMBA=1 does without it"
        ) from error
    if numba.config.DISABLE_JIT:
        return _identity
    everyone = numba.config.CACHE_DIR
    ours = cache_folder()

    def compiled(function: F) -> F:
        numba.config.CACHE_DIR = str(
            ours or ""
        )  # numba reads this when it decorates a function; others rely on it: put it back
        try:
            compile_ = numba.njit(cache=ours is not None, error_model="numpy", _nrt=counted, forceinline=not counted)
            dispatcher = compile_(function)
        finally:
            numba.config.CACHE_DIR = everyone
        if ours is not None:
            kept = dispatcher._cache  # noqa: SLF001  (numba has no option for this)
            kept.save_overload = _as_far_as_the_disk_goes(kept.save_overload)
        return cast("F", dispatcher)

    return compiled


jit = _decorator(counted=False)
jit_views = _decorator(counted=True)
"""The decorator of functions that make arrays of the memory to which they are given pointers."""
COMPILED = jit is not _identity
"""True when the kernel runs as machine code."""
