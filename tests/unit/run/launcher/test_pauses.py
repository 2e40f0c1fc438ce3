"""Pauses of the machine, measured while something makes them."""

import asyncio
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fanet_mw.units import MS
from sim.run.launcher.pauses import PauseWatch, longest_pause_ns, processors

STOPPED_S = 0.3


async def test_what_holds_up_the_launcher_is_counted() -> None:
    watch = PauseWatch()
    await asyncio.sleep(0.1)
    watch.restart()
    for _ in range(2):
        time.sleep(STOPPED_S)  # noqa: ASYNC251  (on purpose)
        await asyncio.sleep(0.1)
    watch.close()
    found = watch.summary()
    assert found["count"] >= 2
    assert found["longest_ms"] >= 1000 * STOPPED_S - 25
    assert found["total_ms"] >= 2 * (1000 * STOPPED_S - 25)
    time.sleep(STOPPED_S)  # noqa: ASYNC251
    await asyncio.sleep(0.05)
    assert watch.summary() == found, "it is closed"


@pytest.mark.slow
def test_a_pause_of_the_process_is_measured_on_whichever_processor() -> None:
    command = (
        "from sim.run.launcher.pauses import longest_pause_ns; print('on', flush=True); print(longest_pause_ns(1.0))"
    )
    measuring = subprocess.Popen([sys.executable, "-c", command], stdout=subprocess.PIPE, text=True)
    assert measuring.stdout is not None
    measuring.stdout.readline()
    time.sleep(0.3)
    os.kill(measuring.pid, signal.SIGSTOP)
    time.sleep(STOPPED_S)
    os.kill(measuring.pid, signal.SIGCONT)
    out, _ = measuring.communicate(timeout=30)
    assert int(out) >= STOPPED_S * 1000 * MS * 0.9


def test_measuring_takes_no_longer_than_it_was_given() -> None:
    began_s = time.monotonic()
    before = os.sched_getaffinity(0)
    assert longest_pause_ns(0.1) >= 0
    assert time.monotonic() < began_s + 5
    assert os.sched_getaffinity(0) == before, "only the measuring threads are bound to a processor"


def test_a_container_may_have_a_fraction_of_its_processors(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    quota = tmp_path / "cpu.max"
    monkeypatch.setattr("sim.run.launcher.pauses._QUOTA", quota)
    all_of_them = processors()
    assert all_of_them == len(os.sched_getaffinity(0)), "there is no such file"
    quota.write_text("50000 100000\n")
    assert processors() == 0.5
    for text in ("max 100000\n", "100000000 100000\n", "nonsense"):
        quota.write_text(text)
        assert processors() == all_of_them
