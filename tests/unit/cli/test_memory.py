"""Too little address space is said in one line, before anything is imported that would end without a word."""

import subprocess
import sys

import pytest
from kit import slow

LIMITED = """
import resource, sys
limit = int(sys.argv.pop(1)) << 20
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
from fanet_mw.__main__ import main
main()
"""


def fanet(limit_mb: int, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", LIMITED, str(limit_mb), *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("limit_mb", [120, *slow(400)])
@pytest.mark.parametrize("command", ["simulate", "sweep", "report", "replay", "launch", "log export", "record", "view"])
def test_a_command_that_has_too_little_says_how_much_it_needs(command: str, limit_mb: int) -> None:
    done = fanet(limit_mb, *command.split(), "quick")
    assert done.returncode == 2
    assert done.stderr.startswith(f"fanet: fanet {command}: needs ")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_a_run_has_enough_where_the_line_ends_and_small_commands_need_little() -> None:
    need_mb = int(fanet(400, "simulate", "quick").stderr.split("needs ")[1].split(" MB")[0])
    short = ("--duration", "1", "--set", "warmup_s=0", "drain_s=0", "--json")
    subprocess.run([sys.executable, "-m", "emulator.compile_kernel"], check=True, timeout=100)
    done = fanet(need_mb + 5, "simulate", "quick", *short)
    assert done.returncode == 0, done.stderr
    assert fanet(120, "check", "quick").returncode == 0
