"""What Wireshark makes of a capture: tshark reads one with the dissector that `fanet dissector` writes."""

import csv
import io
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from sim.cli.app import app

TSHARK = shutil.which("tshark")
pytestmark = pytest.mark.skipif(TSHARK is None, reason="tshark, Wireshark's command-line version, is not installed")

CHECKS = ("ip.check_checksum", "udp.check_checksum", "wlan.check_checksum")
FIELDS = (
    "wlan.fcs.status", "wlan.fc.retry", "ip.src", "radiotap.dbm_antsignal", "radiotap.datarate",
    "radiotap.data_retries", "mavlink_proto.msgid", "mavlink_proto.FANET_ROUTE_prev_hop", "_ws.malformed",
    "_ws.expert.message",
)  # fmt: skip
Row = dict[str, str]


TRANSCRIPT = Path(__file__).parents[2] / "docs" / "how-to" / "transcripts" / "tshark.txt"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of nine UAVs on a channel with path loss, receptions included, and the dissector."""
    folder = tmp_path_factory.mktemp("capture")
    arguments = ["--duration", "10", "--set", "radio.channel=log_distance", "--pcap-receptions", "--json"]
    with pytest.raises(SystemExit) as ended:
        app(["simulate", "quick", "--out", str(folder), *arguments])
    assert ended.value.code == 0
    app(["dissector", str(folder)], exit_on_error=False, result_action="return_value")
    return folder


@pytest.fixture(scope="module")
def rows(folder: Path) -> list[Row]:
    """What tshark shows of each frame."""
    command = [str(TSHARK), "-r", str(folder / "air.pcap"), "-X", f"lua_script:{folder / 'mavlink.lua'}"]
    command += [part for check in CHECKS for part in ("-o", f"{check}:TRUE")]
    command += ["-T", "fields", "-E", "separator=,", "-E", "quote=d", "-E", "aggregator=;", "-E", "header=y"]
    command += [part for field in FIELDS for part in ("-e", field)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    return list(csv.DictReader(io.StringIO(done.stdout)))


def test_a_frame_is_shown_field_by_field(folder: Path) -> None:
    """With FANET_TRANSCRIPTS=1 what is said is written to docs/how-to/transcripts/."""
    said = []
    for words in ("-c 6", "-c 1 -O mavlink_proto", "-q -z io,phs"):
        command = ["-r", "air.pcap", "-X", "lua_script:mavlink.lua", *words.split()]
        done = subprocess.run(
            [str(TSHARK), *command], cwd=folder, capture_output=True, text=True, check=True, timeout=60
        )
        said.append(f"$ tshark {' '.join(command)}\n{done.stdout.rstrip()}\n")
    frames, fields, kinds = said
    assert re.search(
        r"10\.0\.0\.\d+ .* MAVLink 2\.0 .*FANET_ROUTE +HEARTBEAT +GLOBAL_POSITION_INT +FANET_BEACON", frames
    )
    assert re.search(r"Payload: FANET_ROUTE \(53000\)\n +origin_us \(uint64_t\) \[us\]: \d+", fields)
    assert "type (MAV_TYPE): MAV_TYPE_QUADROTOR (2)" in fields
    assert "mavlink_proto" in kinds
    if os.environ.get("FANET_TRANSCRIPTS"):
        TRANSCRIPT.write_text("\n".join(said), encoding="utf-8")


def test_every_frame_is_whole_from_its_frame_check_sequence_to_its_mavlink(rows: list[Row]) -> None:
    assert len(rows) > 1000
    assert {row["wlan.fcs.status"] for row in rows} == {"1"}, "1: it is right"
    assert {row["_ws.malformed"] for row in rows} == {""}
    complaints = {row["_ws.expert.message"] for row in rows} - {""}
    assert all("etransmission" in complaint for complaint in complaints), "no checksum or length is complained about"


def test_messages_have_their_names_and_who_sends_is_the_previous_hop(rows: list[Row]) -> None:
    messages = [row for row in rows if row["mavlink_proto.msgid"]]
    assert all(row["ip.src"] == f"10.0.0.{row['mavlink_proto.FANET_ROUTE_prev_hop']}" for row in messages)
    kinds = {kind for row in messages for kind in row["mavlink_proto.msgid"].split(";")}
    assert {"0", "33", "53000", "53001"} <= kinds, "HEARTBEAT, GLOBAL_POSITION_INT, FANET_ROUTE, FANET_BEACON"


def test_a_reception_has_its_rssi_and_every_frame_its_rate(rows: list[Row]) -> None:
    powers = [int(row["radiotap.dbm_antsignal"]) for row in rows if row["radiotap.dbm_antsignal"]]
    assert len(powers) > 1000
    assert all(-120 < power < 0 for power in powers)
    assert len(set(powers)) > 3, "the farther, the weaker"
    assert {row["radiotap.datarate"] for row in rows} <= {"1", "2", "5.5", "11"}


def test_a_second_attempt_carries_the_retry_flag(rows: list[Row]) -> None:
    sent = [row for row in rows if row["radiotap.data_retries"]]
    again = [row for row in sent if int(row["radiotap.data_retries"]) > 0]
    assert again
    assert all((row["wlan.fc.retry"] in ("1", "True")) == (int(row["radiotap.data_retries"]) > 0) for row in sent)
