"""Sweeps by real processes: the rows are the same whoever carries the runs out, in whatever order."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from distributed import Client

from fanet_mw.results import read
from sim.sweep import spec
from sim.sweep.one_run import carry_out
from sim.sweep.pool import Pool
from sim.sweep.store import TABLE
from sim.sweep.tasks import tasks_of

FILE = """
base = "flooding"
seeds = 4
set = {duration_s = 3, drain_s = 0.5, nodes.count = 9, traffic.interval_s = 0.1, traffic.sources = 8}
grid = {routing.protocol = ["flooding", "gossip"]}
"""
FANET = [sys.executable, "-m", "sim", "sweep"]


@pytest.fixture
def file(tmp_path) -> Path:
    path = tmp_path / "nine.toml"
    path.write_text(FILE)
    return path


def sweep(file: Path, out: Path, *flags: str) -> subprocess.Popen[str]:
    command = [*FANET, str(file), "--out", str(out), *flags]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def complete(file: Path, out: Path, *flags: str) -> None:
    process = sweep(file, out, *flags)
    _, said = process.communicate()
    assert process.returncode == 0, said


def finished(out: Path) -> int:
    return len(list((out / "finished").glob("*.parquet")))


def wait_until(condition: Callable[[], bool], process: subprocess.Popen[str], patience_s: float = 240) -> None:
    """Until something holds; a process that ends before fails the test with its last words."""
    end = time.monotonic() + patience_s
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end, "it did not come to that"
        time.sleep(0.02)


def test_a_run_whose_worker_is_killed_is_carried_out_by_another() -> None:
    tasks = tasks_of(spec.parse(FILE, source="test").model_copy(update={"seeds": 1}))
    pool = Pool(1)
    results = pool.carry_out(tasks)
    first = next(results)
    [worker] = pool._running
    os.kill(worker.process.pid, signal.SIGKILL)
    second = next(results)
    assert list(results) == []
    assert pool._running == []
    here = {task.key: carry_out(task) for task in tasks}
    assert {done.key: (done.summary, done.measured) for done in (first, second)} == {
        key: (done.summary, done.measured) for key, done in here.items()
    }


def test_a_worker_that_was_stopped_keeps_no_sweep_from_ending() -> None:
    pool = Pool(1)
    worker = pool._start()
    os.kill(worker.process.pid, signal.SIGSTOP)
    alarm = threading.Timer(5, os.kill, (worker.process.pid, signal.SIGCONT))
    alarm.start()
    pool.close()
    assert alarm.is_alive()
    alarm.cancel()


@pytest.mark.slow
def test_a_run_that_kills_every_worker_is_a_failed_one(monkeypatch) -> None:
    monkeypatch.setattr("sim.sweep.pool._work", _dying)
    task = tasks_of(spec.parse(FILE, source="test"))[0]
    [done] = Pool(1).carry_out([task])
    assert done.failed
    assert done.error == "the process that ran it died with signal SIGKILL, 2 times"


def _dying(tasks: object) -> None:
    tasks.recv()  # type: ignore[attr-defined]
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.slow
def test_a_sweep_that_is_killed_three_times_ends_as_one_that_was_not(file, tmp_path) -> None:
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    complete(file, whole, "--jobs", "2")
    for count in (1, 3, 5):
        process = sweep(file, killed, "--jobs", "1")
        wait_until(lambda count=count: finished(killed) >= count, process)
        process.kill()
        process.communicate()
        left = finished(killed)
        time.sleep(1)
        assert finished(killed) == left, "a worker outlived the sweep"
    last = sweep(file, killed, "--jobs", "2", "--json")
    out, _ = last.communicate()
    assert last.returncode == 0
    assert '"rows": 8' in out
    assert (killed / TABLE).read_bytes() == (whole / TABLE).read_bytes()


@pytest.mark.slow
def test_an_interrupted_sweep_says_how_to_go_on_and_has_a_table(file, tmp_path) -> None:
    process = sweep(file, tmp_path / "out", "--jobs", "1")
    wait_until(lambda: finished(tmp_path / "out") >= 2, process)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate()
    assert process.returncode == 130
    assert "the same command goes on from there" in said
    assert "Traceback" not in said
    assert read(tmp_path / "out").num_rows >= 2


@contextmanager
def dask(workers: int) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and its workers, as the documents start them."""
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    port = 8700 + os.getpid() % 90
    address = f"tcp://127.0.0.1:{port}"
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    started = [subprocess.Popen([*dask, "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"], **quiet)]
    try:
        for _ in range(workers):
            worker = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
            started.append(subprocess.Popen([*worker, "--no-nanny"], **quiet))
        with Client(address, timeout="120s", set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=120)
        yield address, started[1:]
    finally:
        for process in started:
            process.kill()
            process.wait()


@pytest.mark.slow
def test_two_dask_workers_give_the_rows_of_the_pool_and_killing_one_loses_nothing(file, tmp_path) -> None:
    complete(file, tmp_path / "pool", "--jobs", "2")
    with dask(2) as (address, workers):
        process = sweep(file, tmp_path / "dask", "--scheduler", address)
        wait_until(lambda: finished(tmp_path / "dask") >= 2, process)
        workers[0].kill()
        _, said = process.communicate()
        assert process.returncode == 0, said
    assert (tmp_path / "dask" / TABLE).read_bytes() == (tmp_path / "pool" / TABLE).read_bytes()


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_an_error_of_one_line(file, tmp_path) -> None:
    process = sweep(file, tmp_path / "out", "--scheduler", "tcp://127.0.0.1:9")
    _, said = process.communicate()
    assert process.returncode == 2
    assert "no Dask scheduler answers" in said
    assert "Traceback" not in said
