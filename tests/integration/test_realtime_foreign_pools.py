"""A program with processes of its own ends as it would without us, whether it only looks us up or launches a swarm."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from kit import slow

ROOT = Path(__file__).parents[2]
PROGRAM = """
import multiprocessing, sys, time
import fanet_mw

def square(x):
    return x * x

def forever():
    time.sleep(600)

if __name__ == "__main__":
    kind, what = sys.argv[1:]
    context = multiprocessing.get_context(kind)
    {call}
    if what == "daemon":
        context.Process(target=forever, daemon=True).start()
    else:
        pool = context.Pool(2)
        assert pool.map(square, [2, 3]) == [4, 9]
    print("end of program", flush=True)
"""


def ends(tmp_path: Path, call: str, kind: str, what: str) -> None:
    (tmp_path / "program.py").write_text(PROGRAM.format(call=call))
    ended = subprocess.run(
        [sys.executable, "program.py", kind, what], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "end of program\n", "")


@pytest.mark.parametrize(
    ("kind", "what"), [("forkserver", "pool"), ("spawn", "daemon"), ("spawn", "pool"), ("forkserver", "daemon")]
)
@pytest.mark.slow
def test_a_program_whose_own_processes_live_ends_although_we_were_looked_up(
    tmp_path: Path, kind: str, what: str
) -> None:
    ends(tmp_path, "fanet_mw.launch", kind, what)


@pytest.mark.parametrize("kind", ["forkserver", *slow("spawn")])
def test_a_program_whose_own_processes_live_ends_after_a_launch(tmp_path: Path, kind: str) -> None:
    ends(tmp_path, 'fanet_mw.launch("quick", overrides=["duration_s=1", "drain_s=0", "nodes.count=5"])', kind, "daemon")


SCENARIO = """
duration_s = 1
drain_s = 0
nodes = {count = 2, layout = "line"}
routing = {protocol = "flooding"}
traffic = {arrivals = "none"}
applications = [{use = "forking:Part", nodes = [1]}]
"""
PART = """
import os, time
from fanet_mw import Application

class Part(Application):
    name = "part"

    def __init__(self, scenario, node, options): pass

    def start(self, port, now_ns):
        if not os.fork():
            open("helper", "w").write(str(os.getpid()))
            time.sleep(600)
            os._exit(0)
"""


def test_a_process_that_an_application_has_forked_does_not_hold_up_the_launcher(tmp_path: Path) -> None:
    (tmp_path / "forking.py").write_text(PART)
    (tmp_path / "lone.toml").write_text(SCENARIO)
    launch = [sys.executable, "-m", "fanet_mw", "launch", "lone.toml"]
    path = os.pathsep.join((str(tmp_path), str(ROOT)))
    with (tmp_path / "said").open("w") as said:  # the helper would keep a pipe open
        ended = subprocess.run(
            launch, cwd=tmp_path, env={**os.environ, "PYTHONPATH": path}, stdout=said, stderr=said, timeout=60
        )
    assert ended.returncode in (0, 1), (tmp_path / "said").read_text()
    os.kill(int((tmp_path / "helper").read_text()), signal.SIGKILL)  # it lives
