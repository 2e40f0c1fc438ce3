"""Compilation of the kernel, and where machine code is cached."""

import errno
import os
from pathlib import Path

import pytest

from emulator.kernel import jit

caching = pytest.importorskip("numba.core.caching")


def add(first: int, second: int) -> int:
    return first + second


def test_a_disk_that_cannot_keep_machine_code_costs_time_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not jit.COMPILED:
        pytest.skip("not compiled here")
    asked: list[str] = []

    def full(_: object, name: str, __: object) -> None:
        asked.append(name)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(jit, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(caching.IndexDataCacheFile, "_save_data", full)
    compiled = jit._decorator(counted=True)(add)
    assert compiled(1, 2) == 3
    assert asked, "it was to be kept"
