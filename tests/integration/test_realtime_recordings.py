"""A swarm of processes is recorded beside it, and the recording is whole whatever becomes of the launcher."""

import contextlib
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from fanet_mw.trace import Posed
from sim.cli.app import app
from sim.results.run_folder import RunFolder

FEW = ("--set", "nodes.count=4", "clusters.count=1")


def test_a_launcher_that_is_killed_leaves_no_process_and_a_whole_recording(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    words = ["launch", "quick", *FEW, "--duration", "60", "--record", str(path), "--view", "--swarm", tmp_path.name]
    with subprocess.Popen(
        [sys.executable, "-m", "fanet_mw", *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        while "processes up" not in (line := process.stderr.readline()):
            assert line, "the swarm did not come up"
        time.sleep(2)
        assert len(beside(tmp_path.name)) == 2
        process.kill()
    end_s = time.monotonic() + 90
    while beside(tmp_path.name):
        assert time.monotonic() < end_s, "a view or a recording is left"
        time.sleep(0.3)
    with path.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_summary() is not None, "the file has its index"
        assert len(list(reader.iter_messages(topics=["/poses"]))) > 10


def beside(swarm: str) -> list[str]:
    """The processes that only look at a swarm."""
    commands = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            commands.append((folder / "cmdline").read_bytes().decode(errors="replace").split("\0"))
    return [" ".join(one) for one in commands if swarm in one and {"view", "record"} & set(one) and "launch" not in one]


def test_a_swarm_of_processes_is_recorded_beside_it_from_its_first_moment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its recorder takes seconds longer to start than everything else, as beside other work."""
    (tmp_path / "sitecustomize.py").write_text("import sys, time\n'record' in sys.orig_argv and time.sleep(3)\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    out = tmp_path / "run"
    words = [
        "launch",
        "quick",
        *FEW,
        "--duration",
        "9",
        "--out",
        str(out),
        "--record",
        str(tmp_path / "run.mcap"),
        "--json",
    ]
    app(words, result_action="return_value")
    run = RunFolder(out)
    epoch_ns = run.summary["epoch_unix_ns"]
    with (tmp_path / "run.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = [(c.topic, m.log_time - epoch_ns, d) for _, c, m, d in reader.iter_decoded_messages()]
    posed = {(one.t_ns, one.node): one[2:] for one in run.records(Posed)}
    seen = {
        (t_ns, int(one.child_frame_id.removeprefix("uav-"))): (one.translation.x, one.translation.y, one.translation.z)
        for topic, t_ns, message in found
        if topic == "/tf"
        for one in message.transforms
    }
    both = posed.keys() & seen.keys()
    assert len(both) >= 0.9 * len(posed)  # on a busy machine a put may be lost
    for key in both:
        assert seen[key] == pytest.approx(posed[key], abs=0.006)
    assert any("head of cluster" in message.message for topic, _, message in found if topic == "/log")
    assert {"/metrics", "/links", "/uav/4/state"} <= {topic for topic, _, _ in found}
