"""numba when it is installed, the same source uncompiled otherwise (slow: for debugging and coverage).

FANET_NO_NUMBA=1 in the environment leaves functions uncompiled. Read here, once, and nowhere else.
"""

import os
from collections.abc import Callable
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])


def _identity(function: F) -> F:
    return function


def _decorator() -> Callable[[F], F]:
    if os.environ.get("FANET_NO_NUMBA"):
        return _identity
    try:
        import numba
    except ImportError:
        return _identity
    return cast("Callable[[F], F]", numba.njit(cache=True))


jit = _decorator()
COMPILED = jit is not _identity
"""Whether the kernel is machine code."""
