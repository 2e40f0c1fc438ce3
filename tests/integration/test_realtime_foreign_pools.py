"""A program with processes of its own ends as it would without us, whether it only looks us up or launches a swarm."""

import subprocess
import sys
from pathlib import Path

import pytest
from kit import slow

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
