"""Tells the program that started this process that it is ready: a byte into a pipe, whose number that program gave.

A process that ends before closes the pipe without one.
"""

import contextlib
import os
from typing import Final

VARIABLE: Final = "FANET_READY_FD"


def tell_ready() -> None:
    """Does nothing where nobody waits for it, or when it was told before."""
    number = os.environ.pop(VARIABLE, None)
    if number is not None:
        with contextlib.suppress(OSError, ValueError):
            os.write(int(number), b"\n")
            os.close(int(number))
