"""Commands in surroundings that are seldom tried: closed streams, a full disk, long paths, odd names, no docstrings."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from kit import slow

from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

SHORT = ("quick", "--set", "nodes.count=3", "clusters.count=1", "--duration", "13")


def fanet(
    *arguments: str, closing: str = "", flags: tuple[str, ...] = (), **more: str
) -> "subprocess.CompletedProcess[str]":
    """Run a command; `closing` is what a shell is told of its streams, `more` are environment variables. Its kernel is
    not compiled: reading it takes longer than such a run.
    """
    command = [sys.executable, *flags, "-m", "sim.cli.app", *arguments]
    return subprocess.run(
        ["sh", "-c", f'exec "$@" {closing}', "sh", *command], capture_output=True, text=True, timeout=100,
        env={**os.environ, "FANET_NO_NUMBA": "1", **more},
    )  # fmt: skip


@pytest.mark.parametrize("closing", [">&-", "<&- >&- 2>&-"])
@pytest.mark.slow
def test_a_result_is_whole_when_standard_streams_are_closed(tmp_path: Path, closing: str) -> None:
    """The first file that is opened would otherwise be the standard output."""
    done = fanet("simulate", *SHORT, "--out", str(tmp_path / "out"), closing=closing)
    assert done.returncode == 0
    if "2>" not in closing:
        assert done.stderr == "fanet: standard output is closed: what would be printed there is lost\n"
    whole = fanet("simulate", *SHORT, "--out", str(tmp_path / "whole"))
    assert whole.returncode == 0
    for name in ("scenario.toml", "trace.jsonl", "mavlink.tlog", "links.json"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    assert json.loads((tmp_path / "out/summary.json").read_text("utf-8"))["valid"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
@pytest.mark.parametrize(
    "arguments", [("scenarios",), *slow((("simulate", *SHORT, "--json"),), (("plan", "quick", "--json"),))]
)
def test_a_full_disk_under_the_standard_output_is_one_sentence(arguments: tuple[str, ...]) -> None:
    done = fanet(*arguments, closing="> /dev/full")
    said = f"fanet: standard output: cannot be written: {os.strerror(errno.ENOSPC)}\n"
    assert (done.returncode, done.stderr) == (2, said)


def test_a_file_that_does_not_fit_is_not_left_behind_cut(tmp_path: Path) -> None:
    done = subprocess.run(
        ["bash", "-c", f"ulimit -f 1; exec {sys.executable} -m fanet_mw init mine.toml"], cwd=tmp_path,
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.stderr == "fanet: mine.toml: cannot be written: File too large\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_brackets_in_the_name_of_a_folder_are_no_markup(tmp_path: Path) -> None:
    out = tmp_path / "x[/b]"
    done = fanet("simulate", *SHORT, "--out", str(out))
    assert (done.returncode, done.stderr) == (0, "")
    assert f"written to {out}\n" in done.stdout


def test_brackets_in_names_are_no_markup() -> None:
    done = fanet("simulate", "[bold].toml")
    assert done.stderr == "fanet: [bold].toml: cannot be read: No such file or directory\n"


@pytest.mark.slow
def test_a_folder_for_temporary_files_with_too_long_a_name_is_one_sentence(tmp_path: Path) -> None:
    long = tmp_path / ("d" * 100)
    long.mkdir()
    done = fanet("launch", "quick", "--set", "radio.lead_ms=100", TMPDIR=str(long))
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert f"TMPDIR = {long}" in done.stderr


@pytest.mark.slow
def test_without_docstrings_help_says_what_is_missing() -> None:
    assert "python -OO has removed" in fanet("simulate", "--help", flags=("-OO",)).stderr


@pytest.mark.slow
def test_without_docstrings_a_run_is_the_same() -> None:
    """All sources are compiled anew for it."""
    done = fanet("simulate", *SHORT, "--json", flags=("-OO",))
    assert done.returncode == 0
    scenario = catalog.find("quick", ["nodes.count=3", "clusters.count=1", "duration_s=13"])
    assert json.loads(done.stdout)["trace_sha256"] == finish(simulate(scenario), out=None)["trace_sha256"]
    assert fanet("simulate", "--help", flags=("-O",)).stderr == ""


def test_a_user_without_a_home_is_asked_for_a_folder(tmp_path: Path) -> None:
    nobody = 2_000_000_000  # of whom the system knows no home either
    program = (
        f"import os, sys; os.environ.pop('HOME', 0); os.environ.pop('XDG_DATA_HOME', 0); os.getuid = lambda: {nobody}\n"
        f"sys.argv = ['fanet', 'dialect']; from sim.cli.app import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "fanet: the user has no home folder (HOME is not set): say in which folder to write\n"
    assert fanet("dialect", "--folder", str(tmp_path / "definitions")).returncode == 0
