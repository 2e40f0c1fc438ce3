"""Compiles the kernel ahead of its first use: `python -m emulator.compile_kernel`. numba caches the machine code."""

import contextlib
import sys
from array import array
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Final

from emulator.kernel.jit import COMPILED, cache_folder
from emulator.medium import Medium
from fanet_mw.bus.messages import Poses, TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import config
from fanet_mw.units import BROADCAST, MS, US, NodeId

COMPILING_NOTICE: Final = "compiling the emulator's kernel, once: about half a minute"
"""The message to the user before `warm_up` if `must_compile` is true."""

_MOVE_NS: Final = 50 * US
"""An interval that is shorter than any frame."""
_MOVES: Final = 60


def must_compile() -> bool:
    """True if `warm_up` will take half a minute, because some function's machine code is not cached yet."""
    marker = _marker() if COMPILED else None
    return COMPILED and (marker is None or not marker.exists())


def warm_up() -> bool:
    """Call every compiled function once, including the optional ones; returns True if they run as machine code."""
    _run({})
    _run({"channel": "friis", "shadowing_db": 1.0, "fading": "rician", "capture": True})
    if COMPILED and (marker := _marker()) is not None:
        with contextlib.suppress(OSError):  # without this mark the next process compiles again, which only takes time
            marker.touch()
    return COMPILED


def _marker() -> Path | None:
    """The file that says that all is compiled by this numba and Python; None where machine code cannot be kept."""
    folder = cache_folder()
    return None if folder is None else folder / f"whole-{version('numba')}-{sys.implementation.cache_tag}"


def _run(radio: Mapping[str, object]) -> None:
    scenario = config.build({"nodes": {"count": 2}, "clusters": {"count": 1}, "radio": radio})
    topics = Topics("warm-up")
    medium = Medium(scenario, "warm-up")
    medium.start(0)

    def poses(t_ns: int, east: float) -> Poses:
        return Poses(t_ns, array("H", [1, 2]), array("d", [0.0] * 6 + [east] + [0.0] * 5))

    medium.receive(topics.pose, poses(0, 100.0), 0)
    medium.receive(topics.radio_tx(1), TxRequest(0, 0, b"x", BROADCAST, wants_status=False), 0)
    medium.receive(topics.radio_tx(1), TxRequest(1, 0, b"x" * 500, NodeId(2), wants_status=True), 0)
    for step in range(1, _MOVES + 1):
        medium.receive(topics.pose, poses(step * _MOVE_NS, 100.0 + step), step * _MOVE_NS)
    medium.next_wake_ns()
    medium.stop(20 * MS)


if __name__ == "__main__":
    if must_compile():
        sys.stderr.write(f"{COMPILING_NOTICE}\n")
        warm_up()
