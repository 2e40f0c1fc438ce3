"""How a process tells the program that started it that it is ready: by a byte into a pipe, whose number that program
gave in the environment. A process that ends before it is ready closes the pipe without a byte.
"""

import contextlib
import os
from typing import Final

VARIABLE: Final = "FANET_READY_FD"


def tell_ready() -> None:
    """The first call writes the byte; where nobody waits for it nothing happens."""
    number = os.environ.pop(VARIABLE, None)
    if number is not None:
        with contextlib.suppress(OSError, ValueError):
            os.write(int(number), b"\n")
            os.close(int(number))
