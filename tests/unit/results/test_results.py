"""The files of a run: each is written as far as it goes, and one that fails takes nothing from the others."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fanet_mw import tlog
from fanet_mw.errors import ConfigError
from fanet_mw.whole_file import write_items
from sim.cli.out_folder import OutFolder
from sim.results.file_names import RUN_FILES
from sim.results.files import begin, finish, forget
from sim.results.outcome import Outcome
from sim.results.run_folder import RunFolder
from sim.run.virtual import simulate
from sim.scenarios import catalog


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    return simulate(catalog.find("quick", ["duration_s=6", "warmup_s=3", "drain_s=1"]))


def full_after(monkeypatch: pytest.MonkeyPatch, room: int) -> None:
    """From now on the disk takes so many bytes more: the write call itself says so, a part first."""
    write, left = os.write, room

    def limited(descriptor: int, data: bytes) -> int:
        nonlocal left
        if ".summary" in str(Path(f"/proc/self/fd/{descriptor}").readlink()):
            return write(descriptor, data)  # there is room for it already
        if not left:
            raise OSError(28, os.strerror(28))
        written = write(descriptor, bytes(data[:left]))
        left -= written
        return written

    monkeypatch.setattr("fanet_mw.whole_file.os.write", limited)


def test_a_full_disk_keeps_what_fits_and_says_what_does_not(
    outcome: Outcome, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = tmp_path / "whole"
    finish(outcome, out=whole)
    sizes = {path.name: path.stat().st_size for path in whole.iterdir()}
    small = sum(sizes[name] for name in ("scenario.toml", "reports.json", "links.json"))
    with monkeypatch.context() as patch:
        begin(tmp_path / "full")
        full_after(patch, small + sizes["trace.jsonl"] // 2)
        summary = finish(outcome, out=tmp_path / "full")
    assert summary["unwritten"] == dict.fromkeys(("trace.jsonl", "mavlink.tlog"), "No space left on device")
    assert summary["pdr"] == finish(outcome, out=None)["pdr"]
    assert json.loads((tmp_path / "full/summary.json").read_text()) == summary
    assert not summary["valid"]
    assert "trace.jsonl ends early or is missing: No space left on device" in summary["invalid_because"]
    kept = (tmp_path / "full/trace.jsonl").read_bytes()
    assert (whole / "trace.jsonl").read_bytes().startswith(kept)
    assert kept.endswith(b"]\n")
    assert sizes["trace.jsonl"] // 2 - 200 < len(kept) <= sizes["trace.jsonl"] // 2
    assert list(tlog.read(tmp_path / "full/mavlink.tlog")) == []
    assert {path.name for path in (tmp_path / "full").iterdir()} == {*RUN_FILES}
    assert len(list(RunFolder(tmp_path / "full").records())) == kept.count(b"\n"), "what is there can be looked at"


def killed_before_call(number: int, outcome: Outcome, out: Path) -> int:
    """A child that writes the result and is killed before this write or renaming; returns the signal that ended it."""
    child = os.fork()
    if child == 0:
        left, write, replace = number, os.write, os.replace

        def counted(call: Callable[..., int]) -> Callable[..., int]:
            def counting(*arguments: Any) -> int:
                nonlocal left
                if not left:
                    os.kill(os.getpid(), signal.SIGKILL)
                left -= 1
                return call(*arguments)

            return counting

        os.write, os.replace = counted(write), counted(replace)  # type: ignore[assignment]
        finish(outcome, out=out)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def test_a_run_that_is_killed_while_it_writes_is_no_result(outcome: Outcome, tmp_path: Path) -> None:
    """Six files are written and the summary is renamed; killed before each of these, and after all."""
    for number in range(8):
        out = tmp_path / str(number)
        begin(out)
        signaled = killed_before_call(number, outcome, out)
        summary = json.loads((out / "summary.json").read_text())
        if number < 7:
            assert signaled == -signal.SIGKILL
            assert not summary["valid"]
            with pytest.raises(ConfigError, match="did not end"):
                RunFolder(out)
            folder = OutFolder(out, force=True)
            folder.start()
            folder.replace()
            forget(out)
            assert list(out.iterdir()) == []
        else:
            assert signaled == 0
            assert summary["valid"]
            assert len(list(RunFolder(out).records())) > 100


def test_a_run_begins_where_another_one_was_broken_off_and_leaves_nothing_if_it_raises(tmp_path: Path) -> None:
    out = tmp_path / "run"
    begin(out)
    reserved = {path.name for path in out.iterdir()} - {"summary.json"}
    (out / min(reserved)).write_bytes(b"of another run")
    found = {}

    def run() -> None:
        folder = OutFolder(out, force=True)
        with folder.held():
            folder.start()
            folder.replace()
            found.update({path.name: path.read_bytes() for path in out.iterdir()})
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run()
    assert found.keys() == {*reserved, "summary.json"}
    assert b"another" not in found[min(reserved)]
    assert list(out.iterdir()) == []


def test_a_log_that_is_cut_off_ends_with_a_whole_frame(
    outcome: Outcome, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tlog.write(tmp_path / "whole", outcome.taps)
    full_after(monkeypatch, 777)
    with pytest.raises(OSError, match="No space"):
        tlog.write(tmp_path / "cut", outcome.taps)
    frames = list(tlog.read(tmp_path / "cut"))
    assert 0 < len(frames) < len(list(tlog.read(tmp_path / "whole")))


def test_items_longer_than_a_batch_are_cut_between_items(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    full_after(monkeypatch, 1_000_000)
    with pytest.raises(OSError, match="No space"):
        write_items(tmp_path / "file", [b"x" * 300_000] * 9)
    assert (tmp_path / "file").stat().st_size == 900_000


_LIMITED = """
import resource, sys
from emulator.compile_kernel import warm_up
from sim.cli.app import main
warm_up()  # compiled code is kept in files too
resource.setrlimit(resource.RLIMIT_FSIZE, (16384, resource.RLIM_INFINITY))
sys.argv = ["fanet", "simulate", "quick", "--duration", "12", "--out", sys.argv[1]]
main()
"""


@pytest.mark.slow
def test_a_limit_of_the_size_of_files_costs_the_long_ones_only(tmp_path: Path) -> None:
    """The operating system refuses the writes here, as it does on a full disk, and no disk of one's own is needed."""
    command = [
        sys.executable,
        "-B",
        "-c",
        _LIMITED,
        str(tmp_path / "out"),
    ]  # no bytecode: it would be cut, for all others
    done = subprocess.run(command, capture_output=True, text=True, timeout=110, check=False)
    assert "Traceback" not in done.stderr
    assert "trace.jsonl" in done.stderr
    assert "File too large" in done.stderr
    assert "delivered" in done.stdout, "the summary is printed"
    assert done.returncode == 1
    assert json.loads((tmp_path / "out/summary.json").read_text())["unwritten"]["trace.jsonl"] == "File too large"
    assert (tmp_path / "out/trace.jsonl").read_bytes().endswith(b"]\n")


def test_every_figure_of_a_summary_is_defined_in_the_reference(outcome: Outcome) -> None:
    page = (Path(__file__).parents[3] / "docs/reference/results.md").read_text()
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    defined = set(re.findall(r"`([\w.]+)`", " ".join(rows)))
    summary = finish(outcome, out=None)
    figures = {*summary} | {f"mission.{name}" for name in summary["mission"]}
    whole = {"mission", "air"}  # their figures have rows of their own
    assert figures - defined - whole == set()
