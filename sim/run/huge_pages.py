"""Asks Linux to keep the memory of a long run in huge pages.

A run in virtual time goes through the state of all nodes again and again, which is hundreds of megabytes in pages of
4 kB: far more pages than the processor keeps the addresses of. In pages of 2 MB the same run takes a tenth less CPU
time. The kernel moves memory into such pages on request (`MADV_COLLAPSE`, Linux 6.1). Where it cannot, because it is
older or another system, nothing changes but the speed. The results of a run do not depend on it.

The kernel copies a page when it moves it, which takes from some tenths of a millisecond to 13 ms on a busy machine. So
requests take a small share of the run's CPU time at most: a run of a few seconds is not made slower by them, and a long
one gets all its pages in time. A run that adds little memory gains nothing from them, and makes none.
"""

import ctypes
import math
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

_HUGE_BYTES: Final = 2 << 20
_COLLAPSE: Final = 25  # MADV_COLLAPSE, include/uapi/asm-generic/mman-common.h
_MAPS: Final = Path("/proc/self/maps")
_EVERY_S: Final = 2.0
"""The least CPU time between two rounds of requests [s]. A shorter run makes none."""
_MOST_SHARE: Final = 0.02
"""The greatest share of a run's CPU time that requests may take."""
_LEAST_ADDED: Final = 32
"""The number of huge pages that the memory of a run must have grown by before it asks for any: 64 MB."""
Request = Callable[[int], bool]
"""Asks for the huge page that begins at an address; False if the kernel refuses."""


class HugePages:
    """The huge pages of this process, for which a run asks while its memory grows."""

    def __init__(self, request: Request | None = None, *, cpu_s: Callable[[], float] = time.process_time) -> None:
        """`request`: how to ask for a page; None for the request to the kernel of this system, if it has one.
        `cpu_s`: reads the CPU time of this process.
        """
        self._request = request or _to_kernel()
        self._cpu_s = cpu_s
        self._at_start = len(_pages()) if self._request else 0
        """The number of huge pages into which the memory fitted when the run began."""
        self._asked: set[int] = set()
        """The addresses for which a page was asked for already."""
        self._began_s = cpu_s()
        self._next_s = self._began_s + _EVERY_S
        self._spent_s = 0.0
        """The CPU time that requests have taken."""

    def keep_up(self) -> None:
        """Ask for huge pages if much memory has been added, as far as the share of CPU time for it allows, unless that
        was done a moment ago.
        """
        now_s = self._cpu_s()
        if self._request is not None and now_s >= self._next_s:
            left_s = _MOST_SHARE * (now_s - self._began_s) - self._spent_s
            self.ask(self._request, least=self._at_start + _LEAST_ADDED, until_s=now_s + left_s)
            after_s = self._cpu_s()
            self._spent_s += after_s - now_s
            self._next_s = after_s + _EVERY_S

    def ask(self, request: Request, *, least: int = 0, until_s: float = math.inf) -> int:
        """Ask for every page once, if there are at least `least` pages, until the process has taken `until_s` of CPU
        time; returns the number of pages that the kernel has moved.
        """
        done, pages = 0, _pages()
        for address in pages if len(pages) >= least else ():
            if address in self._asked:
                continue
            if self._cpu_s() >= until_s:
                break
            self._asked.add(address)
            done += request(address)
        return done


def _pages() -> list[int]:
    """The huge pages of this process."""
    return list(huge_pages(_MAPS.read_text()))


def huge_pages(maps: str) -> Iterator[int]:
    """The addresses of all whole huge pages in writable memory that belongs to no file, as the kernel lists it."""
    for line in maps.splitlines():
        span, rights, _, _, inode, *name = line.split(maxsplit=5)
        if rights == "rw-p" and inode == "0" and (not name or name[0] == "[heap]"):
            begin, end = (int(address, 16) for address in span.split("-"))
            yield from range(-(-begin // _HUGE_BYTES) * _HUGE_BYTES, end - _HUGE_BYTES + 1, _HUGE_BYTES)


def _to_kernel() -> Request | None:
    """The request to the kernel; None on a system without it."""
    if sys.platform != "linux":
        return None
    madvise = ctypes.CDLL(None).madvise
    madvise.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)

    def request(address: int) -> bool:
        return bool(madvise(address, _HUGE_BYTES, _COLLAPSE) == 0)

    return request
