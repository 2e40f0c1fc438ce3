"""Swarms that run on this machine are found by name, or because there is only one; dead ones are forgotten."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from fanet_mw.errors import FanetError
from sim.bus.running_swarms import DEFAULT_ENDPOINT, Running, locate, registered, running
from sim.cli.app import app


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "fanet-mw"


def test_a_swarm_is_known_while_it_runs(folder: Path) -> None:
    assert running() == []
    with registered("rescue", "tcp/127.0.0.1:1") as known:
        assert known
        (entry,) = running()
        assert entry[:3] == ("rescue", "tcp/127.0.0.1:1", os.getpid())
        assert folder.stat().st_mode & 0o777 == 0o700
    assert running() == []
    assert list(folder.iterdir()) == []


def test_it_is_forgotten_when_it_ends_by_an_error(folder: Path) -> None:
    with pytest.raises(RuntimeError), registered("rescue", "tcp/127.0.0.1:1"):
        raise RuntimeError
    assert list(folder.iterdir()) == []


def test_the_only_one_is_meant_and_one_of_several_by_its_name() -> None:
    assert locate(None, None) == (DEFAULT_ENDPOINT, None)
    with registered("rescue", "tcp/127.0.0.1:1"):
        assert locate(None, None) == ("tcp/127.0.0.1:1", "rescue")
        assert locate(None, "other") == (DEFAULT_ENDPOINT, "other")
        assert locate("tcp/127.0.0.1:9", None) == ("tcp/127.0.0.1:9", None)
        with registered("quick", "tcp/127.0.0.1:2"):
            assert locate(None, "rescue") == ("tcp/127.0.0.1:1", "rescue")
            said = r"2 swarms .*: quick \(tcp/127\.0\.0\.1:2\), rescue \(tcp/127\.0\.0\.1:1\); say --swarm NAME"
            with pytest.raises(FanetError, match=said):
                locate(None, None)


def test_two_of_one_name_are_told_apart_by_their_endpoints() -> None:
    with (
        registered("rescue", "tcp/127.0.0.1:1"),
        registered("rescue", "tcp/127.0.0.1:2"),
        pytest.raises(FanetError, match="say --connect ENDPOINT"),
    ):
        locate(None, "rescue")


def test_a_file_of_a_dead_process_is_ignored_and_removed(folder: Path) -> None:
    killed = [
        sys.executable, "-c",
        "import os, signal; from sim.bus.running_swarms import registered\n"
        "with registered('dead', 'tcp/127.0.0.1:1'): os.kill(os.getpid(), signal.SIGKILL)",
    ]  # fmt: skip
    subprocess.run(killed, check=False)
    (file,) = folder.iterdir()
    assert json.loads(file.read_text())["swarm"] == "dead"
    assert running() == []
    assert not file.exists()


def test_a_launcher_that_has_died_and_is_not_yet_waited_for_is_gone(folder: Path) -> None:
    with registered("rescue", "tcp/127.0.0.1:1"):
        (file,) = folder.iterdir()
        zombie = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
        entry = Running(**json.loads(file.read_text()))
        started = Path(f"/proc/{zombie.pid}/stat").read_text().rpartition(")")[2].split()[19]
        file.write_text(json.dumps(entry._replace(pid=zombie.pid, started=started)._asdict()))
        assert [swarm.pid for swarm in running()] == [zombie.pid]
        zombie.kill()
        os.waitid(os.P_PID, zombie.pid, os.WEXITED | os.WNOWAIT)
        assert running() == []
        zombie.communicate()


def test_a_process_id_that_is_used_again_is_not_the_swarm(folder: Path) -> None:
    with registered("rescue", "tcp/127.0.0.1:1"):
        (file,) = folder.iterdir()
        entry = Running(**json.loads(file.read_text()))
        file.write_text(json.dumps(entry._replace(started=str(int(entry.started) - 1))._asdict()))
        assert running() == []


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"swarm": 1}', '{"pid": "x"}'])
def test_what_is_no_entry_is_passed_over(folder: Path, text: str) -> None:
    with registered("rescue", "tcp/127.0.0.1:1"):
        (folder / "0.json").write_text(text)
        assert [entry.swarm for entry in running()] == ["rescue"]


def test_a_folder_that_others_may_write_to_is_not_trusted(folder: Path) -> None:
    folder.mkdir(mode=0o777)
    folder.chmod(0o777)
    with registered("rescue", "tcp/127.0.0.1:1") as known:
        assert not known
    (folder / "1.json").write_text(json.dumps(Running("evil", "tcp/10.0.0.1:1", 1, "1")._asdict()))
    assert running() == []


def test_running_swarms_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert app(["swarms"], result_action="return_value") == 0
    assert capsys.readouterr().out == "no swarm runs on this machine\n"
    with registered("rescue", "tcp/127.0.0.1:1"):
        assert app(["swarms"], result_action="return_value") == 0
        assert "rescue" in capsys.readouterr().out
        assert app(["swarms", "--json"], result_action="return_value") == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row == {"swarm": "rescue", "endpoint": "tcp/127.0.0.1:1", "pid": os.getpid()}


def test_a_swarm_of_a_program_whose_name_is_no_ascii_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Linux cuts the name after 15 bytes, in the middle of a character."""
    program = (
        "import ctypes, sys\n"
        "from sim.bus.running_swarms import registered\n"
        "from sim.run.launcher.child_processes import entitle\n"
        "ctypes.CDLL(None).prctl(15, sys.argv[1].encode())\n"
        "entitle(sys.argv[1], 'fanet')\n"
        "entitle(sys.argv[1], 'fanet ' + sys.argv[1])\n"
        "with registered('rescue', 'tcp/127.0.0.1:1'):\n    print('there', flush=True); sys.stdin.read()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program, "\u0440\u043e\u0439-\u0434\u0440\u043e\u043d\u043e\u0432"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "there\n"
    assert [entry.swarm for entry in running()] == ["rescue"]
    process.communicate("")
    assert process.returncode == 0
