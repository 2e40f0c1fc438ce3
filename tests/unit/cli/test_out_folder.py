"""The folder of `--out` is looked at before the run: writable, and nobody else's result."""

import contextlib
import json
import os
import re
import socket
import struct
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from fanet_mw import tlog
from fanet_mw.errors import ConfigError, FanetError
from sim.cli.app import app
from sim.cli.out_folder import OutFolder, alone
from sim.results.file_names import PAGES, RUN_FILES
from sim.results.files import forget

SHORT = ("--set", "duration_s=1", "--set", "warmup_s=0", "--set", "drain_s=0", "--json")


def fanet(*arguments: str) -> int:
    code: int = app([*arguments, *SHORT], result_action="return_value")
    return code


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture
def earlier(tmp_path: Path) -> Path:
    """A folder that holds an earlier result with its pictures and captures, and a file of somebody."""
    out = tmp_path / "earlier"
    (out / "pictures").mkdir(parents=True)
    for name in (*RUN_FILES, *PAGES, "air.pcap", "air-2.pcap", "pictures/quick-1-delays.svg", "notes.txt"):
        (out / name).write_text(f"{name} of the earlier run")
    return out


def replaced(out: Path) -> None:
    """What an earlier run has left makes room, and no run takes it."""
    folder = OutFolder(out, force=True)
    folder.start()
    folder.replace()
    forget(out)


@pytest.fixture
def never_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*_: object, **__: object) -> None:
        pytest.fail("the run has begun")

    monkeypatch.setattr("sim.run.virtual.simulate", run)
    monkeypatch.setattr("sim.run.launcher.swarm.launch", run)


@pytest.mark.parametrize("command", ["simulate", "launch"])
def test_a_folder_that_cannot_be_written_is_found_before_the_run(
    command: str, tmp_path: Path, never_runs: None
) -> None:
    (tmp_path / "file").touch()
    for out in (tmp_path / "file", tmp_path / "file" / "below", Path("/proc/nowhere")):
        with pytest.raises(ConfigError, match=f"--out {out}: cannot be written: "):
            fanet(command, "quick", "--out", str(out))


def test_a_link_to_a_folder_that_does_not_exist_says_so(tmp_path: Path, never_runs: None) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "gone")
    with pytest.raises(ConfigError, match=f"link: cannot be written: a link to {tmp_path / 'gone'}, which does not"):
        fanet("simulate", "quick", "--out", str(tmp_path / "link"))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_the_right_to_write_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(ConfigError, match="Permission denied"):
        OutFolder(tmp_path, force=True)


def test_a_used_folder_is_refused_and_replaced_whole_with_force(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "deep" / "out"
    assert fanet("simulate", "quick", "--seed", "1", "--pcap", "--out", str(out)) == 0
    assert {path.name for path in out.iterdir()} == {*RUN_FILES, "air.pcap"}, "RUN_FILES names all that a run writes"
    assert {stamp // 10**9 for stamp, _ in tlog.read(out / "mavlink.tlog")} == {1_735_689}, "the first of 2025"
    (seconds,) = struct.unpack_from("<I", (out / "air.pcap").read_bytes(), 24)  # of the first record
    assert seconds // 1000 == 1_735_689
    (out / "notes.txt").write_text("mine")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    with pytest.raises(ConfigError, match=r"holds the result of another run \(summary\.json, .*air\.pcap\).*--force"):
        fanet("simulate", "quick", "--seed", "2", "--out", str(out))
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    capsys.readouterr()
    assert fanet("simulate", str(out / "scenario.toml"), "--seed", "2", "--out", str(out), "--force") == 0
    assert json.loads((out / "summary.json").read_text()) == json.loads(capsys.readouterr().out)
    assert {path.name for path in out.iterdir()} == {*RUN_FILES, "notes.txt"}, "the capture was of the other run"
    assert (out / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("name", [*RUN_FILES, *PAGES, "air.pcap", "air-2.pcap"])
def test_one_file_of_another_run_is_enough_to_refuse(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    with pytest.raises(ConfigError, match=name):
        OutFolder(tmp_path, force=False)
    replaced(tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_each_page_that_replaces_another_has_its_own_pictures_alone(tmp_path: Path) -> None:
    for seed in ("1", "2"):
        flags = ("--seed", seed, "--report", "--force", "--out", str(tmp_path))
        assert fanet("simulate", "quick", "--set", "nodes.count=3", "clusters.count=1", *flags) == 0
        assert {path.name.split("-")[1] for path in (tmp_path / "pictures").iterdir()} == {seed}


def test_force_removes_the_pictures_of_the_earlier_page_and_nothing_else_beside_them(tmp_path: Path) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for name in ("quick-1-delays.svg", "mine.png"):
        (pictures / name).touch()
    replaced(tmp_path)
    assert [path.name for path in pictures.iterdir()] == ["mine.png"]
    (pictures / "mine.png").unlink()
    (pictures / "quick-1-delays.svg").touch()
    with pytest.raises(ConfigError, match=r"holds the result of another run \(quick-1-delays\.svg\)"):
        OutFolder(tmp_path, force=False)
    replaced(tmp_path)
    assert not pictures.exists()


@pytest.mark.parametrize("command", ["launch", "router"])
def test_an_endpoint_that_cannot_be_had_costs_no_earlier_result(command: str, earlier: Path) -> None:
    before = contents(earlier)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        listen = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(FanetError, match=re.escape(listen)):
            app([command, "quick", "--listen", listen, "--out", str(earlier), "--force"], result_action="return_value")
    keys = ("--zenoh-config", str(earlier / "notes.txt"))
    with pytest.raises(FanetError, match=r"notes\.txt"):
        app([command, "quick", *keys, "--out", str(earlier), "--force"], result_action="return_value")
    assert contents(earlier) == before


@pytest.mark.parametrize("command", ["simulate", "launch"])
def test_a_run_that_ends_before_its_time_begins_costs_no_earlier_result(
    command: str, earlier: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = contents(earlier)

    def simulated(*_: object, **__: object) -> None:
        assert not json.loads((earlier / "summary.json").read_text())["valid"], "the new run has its own"
        raise ZeroDivisionError

    async def launched(*_: object, on_started: Callable[[object], None], **__: object) -> None:
        assert contents(earlier) == before
        on_started(SimpleNamespace(address=None))
        (earlier / "air.pcap").write_bytes(b"of the new run")
        simulated()

    monkeypatch.setattr("sim.run.virtual.simulate", simulated)
    monkeypatch.setattr("sim.run.launcher.swarm.launch", launched)
    with pytest.raises(ZeroDivisionError):
        fanet(command, "quick", "--pcap", "--out", str(earlier), "--force")
    assert contents(earlier) == before


def test_an_earlier_result_is_gone_once_the_time_of_a_run_has_begun(
    earlier: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def simulated(*_: object, on_progress: Callable[[float], None], **__: object) -> None:
        on_progress(0.1)
        assert not (earlier / ".earlier").exists()
        raise ZeroDivisionError

    monkeypatch.setattr("sim.run.virtual.simulate", simulated)
    with pytest.raises(ZeroDivisionError):
        fanet("simulate", "quick", "--out", str(earlier), "--force")
    assert [*contents(earlier)] == ["notes.txt"]


def test_what_a_killed_run_had_set_aside_is_found_by_the_next_one(earlier: Path) -> None:
    before = contents(earlier)
    OutFolder(earlier, force=True).start()
    with pytest.raises(ConfigError, match="holds the result of another run"):
        OutFolder(earlier, force=False)
    assert contents(earlier) == before


@pytest.mark.parametrize("command", ["simulate", "launch"])
def test_a_folder_in_which_another_run_writes_is_left_alone(command: str, tmp_path: Path, never_runs: None) -> None:
    (tmp_path / "summary.json").write_text("theirs")
    with alone(tmp_path), pytest.raises(ConfigError, match=f"--out {tmp_path}: another run writes there now"):
        fanet(command, "quick", "--out", str(tmp_path), "--force")
    assert (tmp_path / "summary.json").read_text() == "theirs"


def test_a_folder_is_free_when_its_run_is_over(tmp_path: Path) -> None:
    for _ in range(2):
        assert fanet("simulate", "quick", "--out", str(tmp_path), "--force") == 0
    with alone(tmp_path), contextlib.suppress(ConfigError), alone(tmp_path):
        pytest.fail("two have one folder")
    with alone(None), alone(None):
        pass
