"""A machine that does not give enough: one message before anything is started, no traceback and nothing left behind."""

import resource
import subprocess
import sys

import pytest
from kit import slow

from fanet_mw.errors import ConfigError
from sim.run.launcher import limits


@pytest.mark.parametrize(
    ("limit", "what"),
    [
        *slow(("ulimit -n 40", "11 processes need 81 open files in the launcher; the limit is 40 (ulimit -n)")),
        ("ulimit -v 600000", "needs 760 MB of address space, and may have less (ulimit -v)"),
    ],
)
def test_a_limit_that_is_too_low_is_one_message(limit: str, what: str) -> None:
    shell = f"{limit}; exec {sys.executable} -m sim.cli.app launch quick"
    done = subprocess.run(["bash", "-c", shell], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    *notes, error = done.stderr.splitlines()
    assert all(note.startswith("the scenario states no radio.lead_ms") for note in notes)
    assert what in error


def test_a_soft_limit_of_open_files_is_raised_as_far_as_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    given = {resource.RLIMIT_NOFILE: (40, 189), resource.RLIMIT_AS: (resource.RLIM_INFINITY, resource.RLIM_INFINITY)}
    monkeypatch.setattr(resource, "getrlimit", given.__getitem__)
    monkeypatch.setattr(resource, "setrlimit", given.__setitem__)
    limits.prepare(processes=47)
    assert given[resource.RLIMIT_NOFILE] == (189, 189)
    with pytest.raises(ConfigError, match="48 processes need 192 open files"):
        limits.prepare(processes=48)


@pytest.mark.slow
def test_thousands_of_processes_are_announced_before_they_start() -> None:
    shell = f"ulimit -n 4000; exec {sys.executable} -m sim.cli.app launch quick --set nodes.count=3000"
    done = subprocess.run(["bash", "-c", shell], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    note, error = (line for line in done.stderr.splitlines() if "processes" in line)
    assert note.startswith("3,002 processes will be started, one for each UAV, on ")
    assert "3002 processes need 9054 open files" in error, "it says so also where it then refuses"
    assert limits.many(processes=47) is None
