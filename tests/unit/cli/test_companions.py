"""Programs beside a swarm that is launched."""

import os
import signal
import subprocess
from pathlib import Path

import pytest

from fanet_mw.errors import HostError
from fanet_mw.hosts.realtime import SwarmAddress
from sim.cli.companions import Companions
from sim.scenarios import catalog


def test_a_file_in_the_folder_of_whoever_launches_is_no_module_of_theirs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    for name in ("attrs.py", "numpy.py", "fanet_mw.py"):
        (tmp_path / name).write_text("raise SystemExit('mine')\n")
    monkeypatch.chdir(tmp_path)
    with Companions([["record", "x.mcap", "--nonsense"]]) as companions:
        companions.start(SwarmAddress("tcp/127.0.0.1:1", "s"), catalog.find("quick"))
        for running in companions._running:
            assert running.wait(60) == 2
    assert "--nonsense" in capfd.readouterr().err


def test_one_that_fails_before_it_listens_keeps_the_swarm_on_the_ground() -> None:
    with Companions([["record", "x.mcap", "--nonsense"]]) as companions:
        companions.start(SwarmAddress("tcp/127.0.0.1:1", "s"), catalog.find("quick"))
        assert companions.awaited() == ["fanet record"]
        pid = companions._running[0].pid
        assert os.getsid(pid) == os.getsid(0), "it shares the processors with its swarm"
        assert os.getpgid(pid) == pid, "Ctrl-C does not reach it"
        companions._running[0].wait(60)
        with pytest.raises(HostError, match=r"fanet record x\.mcap --nonsense: ended with code 2, so nobody takes off"):
            companions.awaited()


def test_one_that_ends_after_it_has_listened_does_not() -> None:
    with Companions([["view"]]) as companions:
        hears, tells = os.pipe()
        companions._unready[0] = hears
        companions._running.append(subprocess.Popen(["bash", "-c", f"echo >&{tells}; exit 1"], pass_fds=(tells,)))
        os.close(tells)
        companions._running[0].wait(60)
        assert companions.awaited() == []


@pytest.mark.parametrize(
    ("words", "number", "failed"),
    [
        (["record"], signal.SIGKILL, {"record": "signal SIGKILL"}),
        (["record"], signal.SIGTERM, {"record": "signal SIGTERM"}),
        (["view"], signal.SIGKILL, {"view": "signal SIGKILL"}),
        (["view"], signal.SIGTERM, {}),
    ],
)
def test_one_that_did_not_end_in_good_order_is_named_and_a_recording_must_end_by_itself(
    words: list[str], number: int, failed: dict[str, str]
) -> None:
    with Companions([words]) as companions:
        companions._running.append(subprocess.Popen(["sleep", "60"]))
        companions._running[0].send_signal(number)
        companions._running[0].wait(60)
    assert companions.failed == failed
