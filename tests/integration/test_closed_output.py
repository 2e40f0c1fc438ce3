"""Commands whose reader has gone away: `fanet plan clusters | head -1` and the like."""

import os
import subprocess
import sys

import pytest

SIGPIPE = 128 + 13


@pytest.mark.parametrize(
    "arguments",
    [
        ("plan", "quick", "--set", "nodes.count=5"),
        ("scenarios",),
        ("--help",),
    ],
)
def test_a_command_ends_quietly_when_nobody_reads(arguments: tuple[str, ...]) -> None:
    read, write = os.pipe()
    os.close(read)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "sim.cli.app", *arguments],
            stdout=write,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
        )
    finally:
        os.close(write)
    assert done.stderr == ""
    assert done.returncode == SIGPIPE
