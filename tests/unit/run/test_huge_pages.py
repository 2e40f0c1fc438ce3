"""Huge pages for the memory of a long run."""

import itertools
import mmap
import sys

import pytest

from sim.run.huge_pages import HugePages, huge_pages

_HUGE = 2 << 20
_MAPS = f"""\
400000-{0x400000 + 9 * _HUGE:x} rw-p 00000000 00:00 0                  [heap]
{0x7F0000100000:x}-{0x7F0000100000 + 2 * _HUGE:x} rw-p 00000000 00:00 0
{0x7F1000000000:x}-{0x7F1000000000 + 4 * _HUGE:x} r--p 00000000 08:01 1234       /usr/lib/libpython3.11.so
{0x7F2000000000:x}-{0x7F2000000000 + 4 * _HUGE:x} rw-p 00000000 08:01 1234       /usr/lib/libpython3.11.so
{0x7F3000000000:x}-{0x7F3000000000 + 4 * _HUGE:x} rw-s 00000000 00:01 77
{0x7FFC00000000:x}-{0x7FFC00000000 + 4 * _HUGE:x} rw-p 00000000 00:00 0          [stack]
"""


def test_whole_huge_pages_in_memory_of_this_process_alone_are_asked_for() -> None:
    """Not in files, in memory that is shared with other processes, or on the stack; and no page that begins or ends
    outside of a piece of memory.
    """
    assert list(huge_pages(_MAPS)) == [*range(0x400000, 0x400000 + 9 * _HUGE, _HUGE), 0x7F0000200000]


@pytest.mark.skipif(sys.platform != "linux", reason="the list of a process's memory is Linux's")
def test_a_page_is_asked_for_once_however_often_a_run_asks() -> None:
    asked: list[int] = []

    def request(address: int) -> bool:
        asked.append(address)
        return True

    pages = HugePages()
    before = pages.ask(request)
    with mmap.mmap(-1, 4 * _HUGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS):
        added = pages.ask(request)
    assert before > 0
    assert added > 0
    assert len(asked) == len(set(asked)) == before + added


@pytest.mark.skipif(sys.platform != "linux", reason="the list of a process's memory is Linux's")
@pytest.mark.parametrize(("added", "asks"), [(16, False), (64, True)])
def test_a_run_that_adds_little_memory_asks_for_no_page(added: int, asks: bool) -> None:
    asked: list[int] = []

    def request(address: int) -> bool:
        asked.append(address)
        return True

    times_s = itertools.chain((0.0,), itertools.repeat(10.0))
    pages = HugePages(request, cpu_s=lambda: next(times_s))
    with mmap.mmap(-1, added * _HUGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS):
        pages.keep_up()
    assert bool(asked) is asks


@pytest.mark.skipif(sys.platform != "linux", reason="the list of a process's memory is Linux's")
def test_requests_take_a_small_share_of_the_cpu_time_however_dear_a_page_is() -> None:
    page_s, step_s, run_s = 0.013, 0.05, 20.0
    spent_s: list[float] = []
    own_s = 0.0

    def request(_: int) -> bool:
        spent_s.append(page_s)
        return True

    pages = HugePages(request, cpu_s=lambda: own_s + sum(spent_s))
    with mmap.mmap(-1, 512 * _HUGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS):  # more than there is time for
        while own_s < run_s:
            own_s += step_s
            pages.keep_up()
            assert sum(spent_s) <= 0.02 * (own_s + sum(spent_s)) + page_s  # the last request may end too late
    assert sum(spent_s) > 0.015 * run_s
