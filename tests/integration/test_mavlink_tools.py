"""Other people's MAVLink tools know our messages, with what `fanet dialect` gives them."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pymavlink
import pytest

from agents.applications.telemetry_streams import TelemetryStreams
from fanet_mw import tlog
from fanet_mw.errors import ConfigError
from fanet_mw.units import Enu, NodeId, S
from fanet_mw.wire.survivors import Survivor
from sim.cli.app import app
from sim.cli.tool_files import write_dialect

INSTALLED = Path(pymavlink.__file__).parent
SURVIVOR = Survivor(t_us=1_500_000, survivor=3, reporter=1, position=Enu(1.0, 2.0, 3.0), rssi_dbm=-70.5)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A second of telemetry, and a survivor report."""
    streams = TelemetryStreams(NodeId(1), position=Enu(0.0, 0.0, 50.0), telemetry_hz=4)
    path = tmp_path / "mavlink.tlog"
    tlog.write(path, [(S, streams.telemetry(S)), (2 * S, SURVIVOR.encode_frame(NodeId(1)))])
    return path


@pytest.fixture
def fresh_pymavlink(tmp_path: Path) -> Path:
    """pymavlink with no dialect generated yet: it keeps what it generates beside its own, and not in ours by a test."""
    package = tmp_path / "packages" / "pymavlink"
    for name in ("", "tools", "generator", "dialects", "dialects/v20", "dialects/v10"):
        (package / name).mkdir(parents=True, exist_ok=True)
        for file in sorted((INSTALLED / name).glob("__init__.py" if name.startswith("dialects") else "*.py")):
            shutil.copy(file, package / name)
    shutil.copy(INSTALLED / "generator" / "mavschema.xsd", package / "generator")
    return package


def test_mavlogdump_shows_a_survivor_report_by_name(
    log: Path, fresh_pymavlink: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert app(["dialect", str(tmp_path / "definitions"), "--definitions"], result_action="return_value") == 0
    environment = {
        **os.environ, "PYTHONPATH": str(fresh_pymavlink.parent), "MAVLINK20": "1", "MAVLINK_DIALECT": "fanet",
        "MDEF": capsys.readouterr().out.strip(),
    }  # fmt: skip
    tool = fresh_pymavlink / "tools" / "mavlogdump.py"
    command = [sys.executable, str(tool), "--dialect", "fanet", str(log)]
    said = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=60).stdout
    assert re.search(r"FANET_SURVIVOR \{t_us : 1500000, survivor : 3, east : 1\.0, .*rssi : -70\.5, reporter : 1", said)
    assert "HEARTBEAT" in said
    assert "UNKNOWN" not in said


def test_the_path_of_the_dialect_is_printed_and_all_that_it_includes_is_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    for _ in range(2):  # it may be there already
        assert app(["dialect"], result_action="return_value") == 0
    path = Path(capsys.readouterr().out.splitlines()[-1])
    assert path == tmp_path / "fanet-mw" / "message_definitions" / "v1.0" / "fanet.xml"
    for file in path.parent.iterdir():
        for name in re.findall(r"<include>(.*)</include>", file.read_text()):
            assert (path.parent / name).is_file(), f"{file.name} includes it"
    assert {file.name for file in path.parent.iterdir()} >= {"fanet.xml", "common.xml", "minimal.xml"}


def test_a_folder_that_cannot_be_written_is_one_message(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match="cannot be written"):
        write_dialect(tmp_path / "file")
