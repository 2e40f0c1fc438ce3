"""The capture, read back by a parser written from the formats' specifications, and by tshark where there is one."""

import json
import shutil
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from types import FrameType
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_medium_timelines import ACK_NS, DIFS_NS, FRAME_NS, PAYLOAD, SIFS_NS, Air

from emulator.medium import Medium
from emulator.pcap import Pcap, checksum
from emulator.pcap_file import PcapFile, captures, unused
from emulator.pcap_reader import AirFrame, frames_of
from fanet_mw import mavlink, wire
from fanet_mw.bus.messages import Reception
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Radio, Scenario
from fanet_mw.units import BROADCAST, MS, US, S
from sim.cli.app import app
from sim.run.virtual import simulate
from sim.scenarios import catalog

MakeScenario = Callable[..., Scenario]
RADIOTAP_FIELDS = [  # radiotap.org: bit, name, size, alignment
    (1, "flags", 1, 1), (2, "rate", 1, 1), (3, "channel", 4, 2), (5, "signal", 1, 1), (10, "power", 1, 1),
    (11, "antenna", 1, 1), (17, "retries", 1, 1),
]  # fmt: skip


class Seen(NamedTuple):
    """One record, taken apart."""

    t_ns: int
    tap: dict[str, int]
    mac: bytes
    payload: bytes

    @property
    def is_ack(self) -> bool:
        return self.mac[0] == 0xD4

    @property
    def retry(self) -> bool:
        return bool(self.mac[1] & 0x08)

    @property
    def seq(self) -> int:
        return struct.unpack_from("<H", self.mac, 22)[0] >> 4


def words(data: bytes) -> int:
    """The one's complement sum of 16-bit words as RFC 1071 describes it: carries are added back."""
    total = sum(word for (word,) in struct.iter_unpack(">H", data + b"\x00" * (len(data) % 2)))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return total


def radiotap(data: bytes) -> tuple[dict[str, int], int]:
    version, pad, length, present = struct.unpack_from("<BBHI", data)
    assert (version, pad) == (0, 0)
    found, at = {}, 8
    for bit, name, size, alignment in RADIOTAP_FIELDS:
        if present & 1 << bit:
            at = -(-at // alignment) * alignment
            found[name] = int.from_bytes(data[at : at + size], "little", signed=name in ("signal", "power"))
            at += size
            present ^= 1 << bit
    assert present == 0, "no field that is not known"
    assert at == length
    return found, length


def read(data: bytes) -> Iterator[Seen]:
    """Every record of a capture; asserts what must hold of each."""
    magic, major, minor, zone, sigfigs, snaplen, link = struct.unpack_from("<IHHiIII", data)
    assert (magic, major, minor, zone, sigfigs, link) == (0xA1B23C4D, 2, 4, 0, 0, 127)
    at = 24
    while at < len(data):
        seconds, rest_ns, size, whole = struct.unpack_from("<IIII", data, at)
        assert rest_ns < S
        assert size == whole <= snaplen
        record = data[at + 16 : at + 16 + size]
        assert len(record) == size
        at += 16 + size
        tap, length = radiotap(record)
        frame, fcs = record[length:-4], record[-4:]
        assert tap["flags"] & 0x10, "the FCS is there"
        assert zlib.crc32(frame).to_bytes(4, "little") == fcs
        t_ns = seconds * S + rest_ns
        yield Seen(t_ns, tap, frame, b"" if frame[0] == 0xD4 else network(frame))


def network(frame: bytes) -> bytes:
    """The UDP payload of an 802.11 data frame."""
    assert frame[0] == 0x08, "data"
    assert frame[1] & 0x03 == 0, "neither to nor from a distribution system: IBSS"
    assert frame[24:32] == bytes.fromhex("aaaa030000000800")
    ip = frame[32:]
    assert ip[0] == 0x45
    assert ip[9] == 17
    assert int.from_bytes(ip[2:4], "big") == len(ip)
    assert words(ip[:20]) == 0xFFFF
    udp = ip[20:]
    assert struct.unpack_from(">HHH", udp) == (14550, 14550, len(udp))
    assert udp[6:8] != b"\x00\x00", "a checksum of zero would mean none"
    assert words(ip[12:20] + b"\x00\x11" + udp[4:6] + udp) == 0xFFFF
    return udp[8:]


class Buffer:
    """A capture in memory."""

    def __init__(self, radio: Radio, *, receptions: bool = False) -> None:
        self.parts: list[bytes] = []
        self.pcap = Pcap(self.parts.append, radio, receptions=receptions)

    def seen(self) -> list[Seen]:
        return list(read(b"".join(self.parts)))


def capture(air: Air, scenario: Scenario, *, receptions: bool = False) -> Buffer:
    """The same air again, with a capture."""
    buffer = Buffer(scenario.radio, receptions=receptions)
    air.medium = Medium(scenario, "test", capture=buffer.pcap)
    air.medium.start(0)
    return buffer


# --- one frame --------------------------------------------------------------------------------------------------------


@given(st.binary(max_size=300))
def test_the_checksum_is_the_internets(data: bytes) -> None:
    total = words(data)
    assert checksum(data) == (0xFFFF - total if total else 0)


@pytest.mark.parametrize(("preamble", "flag"), [("long", 0), ("short", 0x02)])
def test_a_unicast_and_its_ack_are_two_records_at_their_instants(
    make_scenario: MakeScenario, preamble: str, flag: int
) -> None:
    scenario = make_scenario(**{"nodes.count": 2, "radio.preamble": preamble, "radio.tx_power_dbm": 17})
    air = Air(scenario, [0, 150])
    buffer = capture(air, scenario)
    buffer.pcap.epoch_unix_ns = 1_700_000_000 * S + 5
    air.place([0, 150], 0)
    air.send(1, 1 * MS, dst=2)
    air.run()
    data, ack = buffer.seen()
    begin_ns, saved_ns = 1_700_000_000 * S + 5 + 1 * MS, 96 * US if flag else 0
    assert data.t_ns == begin_ns
    assert ack.t_ns == begin_ns + FRAME_NS - saved_ns + 500 + SIFS_NS
    assert data.payload == PAYLOAD
    channel = 2412 | 0x00A0 << 16
    assert data.tap == {"flags": 0x10 | flag, "rate": 22, "channel": channel, "power": 17, "retries": 0}
    assert data.mac[4:22] == bytes.fromhex("02fa4e450002 02fa4e450001 02fa4e45ffff")
    assert struct.unpack_from("<H", data.mac, 2) == ((SIFS_NS + ACK_NS - saved_ns) // US,), "reserves SIFS and ACK"
    assert len(data.mac) + 4 == 1024 + 64, "what is charged on the air"
    assert ack.mac == bytes.fromhex("d4000000 02fa4e450001")


def test_a_broadcast_goes_to_everyone_and_reserves_nothing(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 3})
    air = Air(scenario, [0, 150, 200])
    buffer = capture(air, scenario)
    air.place([0, 150, 200], 0)
    air.send(3, 1 * MS, payload=b"odd")
    air.run()
    (only,) = buffer.seen()
    assert only.mac[2:10] == b"\x00\x00" + b"\xff" * 6
    assert only.mac[44:52] == bytes([10, 0, 0, 3, 10, 0, 255, 255])
    assert only.payload == b"odd"


def test_every_attempt_is_a_record_and_retries_say_so(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 2})
    air = Air(scenario, [0, 4000])
    buffer = capture(air, scenario)
    air.place([0, 4000], 0)
    air.send(1, 1 * MS, dst=2)
    air.run()
    seen = buffer.seen()
    assert [record.retry for record in seen] == [False, *[True] * 6]
    assert [record.tap["retries"] for record in seen] == list(range(7))
    assert {record.seq for record in seen} == {0}
    assert all(b.t_ns - a.t_ns >= FRAME_NS + DIFS_NS for a, b in pairwise(seen))


def test_receptions_are_records_with_their_rssi_if_they_are_wanted(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 3, "radio.channel": "log_distance"})
    air = Air(scenario, [0, 50, 100])
    buffer = capture(air, scenario, receptions=True)
    air.place([0, 50, 100], 0)
    air.send(1, 1 * MS)
    heard = [h.message for h in air.run() if isinstance(h.message, Reception)]
    sent, *received = buffer.seen()
    assert "signal" not in sent.tap
    assert [(r.t_ns, r.tap["signal"]) for r in received] == [(m.end_ns, round(m.rssi_dbm)) for m in heard]
    assert [r.tap["antenna"] for r in received] == [2, 3]
    assert {r.payload for r in received} == {PAYLOAD}


def test_what_is_received_at_the_second_attempt_is_a_retry(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 2})
    air = Air(scenario, [0, 4000])
    buffer = capture(air, scenario, receptions=True)
    air.send(1, 1 * MS, dst=2)
    air.run(until_ns=2100 * US)
    air.place([0, 150], 2100 * US)
    air.run()
    sent = [record for record in buffer.seen() if "antenna" not in record.tap and not record.is_ack]
    received = [record for record in buffer.seen() if "antenna" in record.tap and not record.is_ack]
    assert [record.retry for record in sent] == [False, True]
    assert [record.retry for record in received] == [True]


# --- whole runs -------------------------------------------------------------------------------------------------------


def test_a_capture_changes_nothing_and_holds_every_frame_of_a_run() -> None:
    scenario = catalog.find("quick", ["duration_s=7", "drain_s=0.5", "radio.handover_ms=10", "world.engine=kinematic"])
    buffer = Buffer(scenario.radio, receptions=True)
    outcome, plain = simulate(scenario, capture=buffer.pcap), simulate(scenario)
    assert list(outcome.records) == list(plain.records)
    seen = buffer.seen()
    report = outcome.reports["emulator"]
    sent = [record for record in seen if "power" in record.tap and not record.is_ack]
    dropped = report["frames"]["dropped"]
    assert not {"mac_queue_full", "mac_lifetime", "late"} & set(dropped), "all were sent"
    first = [record for record in sent if not record.retry]
    assert abs(len(first) - report["frames"]["sent"]) <= report["frames"]["in_flight"]
    assert sum("antenna" in record.tap for record in seen) == sum(report["handed"].values())
    assert any(record.is_ack for record in seen)
    instants = [record.t_ns for record in seen]
    assert instants == sorted(instants)
    for record in sent:
        assert wire.decode_header(record.payload).prev_hop == int.from_bytes(record.mac[14:16], "big")
        assert mavlink.decode(record.payload)[0].get_type() == "FANET_ROUTE"


def test_a_record_costs_a_few_calls_however_many_there_were_before(make_scenario: MakeScenario) -> None:
    """Calls are counted, because time depends on the machine: a record takes 4 us."""
    pcap = Pcap(lambda _: None, make_scenario().radio)
    calls: list[int] = []

    def count(_frame: FrameType, event: str, _argument: object) -> None:
        calls[-1] += event in ("call", "c_call")

    for i in range(20_000):
        if i in (1, 19_999):
            calls.append(0)
            sys.setprofile(count)
        pcap.transmitted(i, 1, BROADCAST, i, PAYLOAD, 1)
        sys.setprofile(None)
    assert calls[1] == calls[0] < 50


# --- files and commands -----------------------------------------------------------------------------------------------


def test_the_command_writes_a_capture_beside_the_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    short = ("--set", "duration_s=6", "--set", "drain_s=0.5", "--json")
    command = ["simulate", "quick", *short, "--pcap", "--out", str(tmp_path), "--force"]
    (tmp_path / "air-2.pcap").write_bytes(b"of an earlier run")
    (tmp_path / "airport.pcap").write_bytes(b"of somebody else")
    assert app(command, result_action="return_value") == 0
    summary = json.loads(capsys.readouterr().out)
    assert len(list(read((tmp_path / "air.pcap").read_bytes()))) >= summary["frames"]["delivered"] > 100
    assert not (tmp_path / "air-2.pcap").exists()
    assert (tmp_path / "airport.pcap").exists()
    with pytest.raises(ConfigError, match="--pcap: needs --out DIR"):
        app(["simulate", "quick", "--pcap"], result_action="return_value")


def test_a_capture_that_cannot_be_opened_is_one_sentence_and_a_full_disk_ends_it_only(
    tmp_path: Path, make_scenario: MakeScenario, capsys: pytest.CaptureFixture[str]
) -> None:
    radio = make_scenario().radio
    with pytest.raises(ConfigError, match=r"--pcap: .* cannot be written"):
        PcapFile(tmp_path, radio)
    with PcapFile(Path("/dev/full"), radio) as file:
        for i in range(1000):
            file.pcap.transmitted(i, 1, BROADCAST, i, PAYLOAD, 1)
    assert capsys.readouterr().err.count("the capture ends here: No space left on device") == 1


def test_a_capture_that_somebody_removes_meanwhile_ends_there_and_says_so(
    make_scenario: MakeScenario, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "air.pcap"
    with PcapFile(path, make_scenario().radio) as file:
        assert file.pcap.failure() is None
        path.unlink()
        assert file.pcap.failure() == "No such file or directory"
    assert capsys.readouterr().err == f"{path}: the capture ends here: No such file or directory\n"


def test_a_capture_by_a_relative_path_goes_on_when_a_part_changes_the_working_folder(
    make_scenario: MakeScenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with PcapFile(Path("air.pcap"), make_scenario().radio) as file:
        monkeypatch.chdir("/")
        assert file.pcap.failure() is None


def test_what_was_captured_a_second_ago_can_be_read_while_the_run_goes_on(
    tmp_path: Path, make_scenario: MakeScenario
) -> None:
    path = tmp_path / "air.pcap"
    with PcapFile(path, make_scenario().radio) as file:
        for t_ns in (0, 400 * MS, 999 * MS):
            file.pcap.transmitted(t_ns, 1, BROADCAST, 0, PAYLOAD, 1)
        assert not path.read_bytes(), "gathered"
        for t_ns in (1001 * MS, 1002 * MS):
            file.pcap.transmitted(t_ns, 1, BROADCAST, 0, PAYLOAD, 1)
        assert [record.t_ns // MS for record in read(path.read_bytes())] == [0, 400, 999, 1001]
    assert len(list(read(path.read_bytes()))) == 5


def test_an_emulator_that_starts_again_keeps_the_capture_of_the_last_one(tmp_path: Path) -> None:
    for name in ("air.pcap", "air-2.pcap", "air-3.pcap"):
        path = unused(tmp_path / "air.pcap")
        assert path.name == name
        path.touch()
    (tmp_path / "air-10.pcap").touch()
    names = [path.name for path in captures(tmp_path / "air.pcap")]
    assert names == ["air.pcap", "air-2.pcap", "air-3.pcap", "air-10.pcap"], "in the order in which they were made"


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_reads_it_without_complaint(tmp_path: Path) -> None:
    path = tmp_path / "air.pcap"
    scenario = catalog.find("contention_unicast", ["duration_s=0.5", "drain_s=0", "nodes.count=3"])
    with PcapFile(path, scenario.radio, receptions=True) as file:
        simulate(scenario, capture=file.pcap)
    fields = ["frame.time_epoch", "wlan.fcs.status", "ip.checksum.status", "udp.checksum.status"]
    options = ["-o", "wlan.check_checksum:TRUE", "-o", "ip.check_checksum:TRUE", "-o", "udp.check_checksum:TRUE"]
    command = ["tshark", "-r", str(path), *options, "-T", "fields", *(x for name in fields for x in ("-e", name))]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert len(lines) == len(list(read(path.read_bytes())))
    assert all(set(line.split("\t")[1:]) <= {"1", ""} for line in lines), "good, or not there (ACKs)"


def test_a_channel_without_powers_gives_receptions_no_signal(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 2})
    air = Air(scenario, [0, 50])
    buffer = capture(air, scenario, receptions=True)
    air.place([0, 50], 0)
    air.send(1, 1 * MS)
    air.run()
    _, received = buffer.seen()
    assert (received.tap["antenna"], "signal" in received.tap) == (2, False)
    assert received.payload == PAYLOAD


def test_sequence_numbers_are_given_at_the_first_transmission_and_kept_by_retries() -> None:
    """802.11-2020, 10.3.2.14: one more for each new frame; a request that was made first may be sent later."""
    written: list[bytes] = []
    pcap = Pcap(written.append, Radio(), receptions=True)
    pcap.transmitted(0, 1, 2, 7, PAYLOAD, 1)
    pcap.transmitted(1, 1, 2, 7, PAYLOAD, 2)
    pcap.received(2, 2, 1, 2, 7, PAYLOAD, -50.0)
    pcap.transmitted(3, 1, BROADCAST, 5, PAYLOAD, 1)
    pcap.transmitted(4, 3, BROADCAST, 9, PAYLOAD, 1)
    frames = [record[16 + int.from_bytes(record[18:20], "little") :] for record in written[1:]]
    numbers = [int.from_bytes(frame[22:24], "little") >> 4 for frame in frames]
    assert numbers == [0, 0, 0, 1, 0]
    assert [bool(frame[1] & 0x08) for frame in frames] == [False, True, True, False, False]


# --- read back --------------------------------------------------------------------------------------------------------

EPOCH_NS = 1_700_000_000 * S
nodes = st.integers(1, 0xFFFE)
records = st.one_of(
    st.tuples(
        st.just("sent"), nodes, st.one_of(nodes, st.just(BROADCAST)), st.integers(1, 7),
        st.one_of(st.binary(max_size=40), st.just(bytes(2304))),
    ),
    st.tuples(st.just("ack"), nodes, nodes),
    st.tuples(st.just("received"), nodes, st.one_of(nodes, st.just(BROADCAST)), nodes, st.integers(-120, 20)),
)  # fmt: skip


@given(st.lists(st.tuples(st.integers(0, 10**10), records), max_size=8), st.booleans())
def test_the_reader_finds_what_was_captured(
    tmp_path_factory: pytest.TempPathFactory, happened: list[tuple[int, tuple]], has_powers: bool
) -> None:
    """Sequence numbers are left out: nobody reads them."""
    path = tmp_path_factory.mktemp("capture") / "air.pcap"
    expected = []
    with path.open("wb") as file:
        radio = Radio(channel="log_distance" if has_powers else "range")
        pcap = Pcap(file.write, radio, receptions=True)
        pcap.epoch_unix_ns = EPOCH_NS
        for t_ns, (what, *of) in happened:
            match what:
                case "sent":
                    src, dst, attempt, payload = of
                    pcap.transmitted(t_ns, src, dst, 7, payload, attempt)
                    to = None if dst == BROADCAST else dst
                    expected.append(AirFrame(t_ns, "sent", src, to, None, len(payload), attempt, None, payload))
                case "ack":
                    src, dst = of
                    pcap.acknowledged(t_ns, src, dst)
                    expected.append(AirFrame(t_ns, "ack", None, dst, None, 0, None, None))
                case "received":
                    src, dst, station, rssi_dbm = of
                    pcap.received(t_ns, station, src, dst, 7, PAYLOAD, float(rssi_dbm))
                    to, heard = None if dst == BROADCAST else dst, rssi_dbm if has_powers else None
                    expected.append(AirFrame(t_ns, "received", src, to, station % 256, len(PAYLOAD), None, heard))
    assert list(frames_of(path, epoch_unix_ns=EPOCH_NS)) == expected


def test_a_capture_is_read_up_to_where_it_is_cut_off_or_foreign(tmp_path: Path) -> None:
    """A record may be as long as pcap lets it be; a length beyond that is no length."""
    parts: list[bytes] = []
    Pcap(parts.append, Radio()).transmitted(5, 1, 2, 7, PAYLOAD, 1)
    head, record = parts
    path = tmp_path / "air.pcap"

    def read_back(*written: bytes) -> int:
        path.write_bytes(b"".join(written))
        return sum(1 for _ in frames_of(path, epoch_unix_ns=0))

    def of_length(size: int) -> bytes:
        return struct.pack("<IIII", 0, 0, size, size) + record[16:].ljust(size, b"\0")

    assert read_back(head) == 0
    assert read_back(head, record, of_length(1 << 16)) == 2

    def of_bytes(data: bytes) -> bytes:
        return struct.pack("<IIII", 0, 0, len(data), len(data)) + data

    beyond = struct.pack("<BBHI", 0, 0, 100, 0) + bytes(70)
    no_frame = struct.pack("<BBHI", 0, 0, 15, 0) + bytes(7) + b"\x08" + bytes(62)
    for wrong in (record[:10], record[:-1], of_length((1 << 16) + 1), *map(of_bytes, (b"", beyond, no_frame))):
        with pytest.raises(ConfigError, match=r"is cut off.* at byte \d+"):
            read_back(head, record, wrong)
    for no_head in (b"", head[:-1], bytes(4) + head[4:], head[:-4] + struct.pack("<I", 105)):
        with pytest.raises(ConfigError, match="is no capture of radiotap frames"):
            read_back(no_head)
