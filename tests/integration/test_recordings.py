"""What other tools read of a run is what the run was: tables, recordings, and the result that is loaded again."""

import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import duckdb
import nbformat
import pandas as pd
import pytest
from foxglove_schemas_protobuf import (
    FrameTransforms_pb2,
    LocationFix_pb2,
    Log_pb2,
    PosesInFrame_pb2,
    SceneUpdate_pb2,
)
from google.protobuf import descriptor_pb2, unknown_fields
from kit import slow
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory

import fanet_mw
from fanet_mw.errors import ConfigError
from fanet_mw.mavlink import Geodetic, to_enu
from fanet_mw.trace import Detected, Dropped, Posed, RoleChanged
from fanet_mw.units import US, S
from sim.cli.app import app
from sim.recording import tables
from sim.recording.mcap_recording import McapRecording
from sim.results.run_folder import RunFolder
from sim.run.virtual import EPOCH_UNIX_NS, simulate
from sim.scenarios import catalog

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "how-to" / "recordings.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of nine UAVs that hears survivors, with a capture and a recording."""
    out = tmp_path_factory.mktemp("runs") / "rescue"
    words = ["simulate", "quick", "--out", str(out), "--pcap", "--pcap-receptions", "--record", str(out / "run.mcap")]
    assert app([*words, "--json"], result_action="return_value") == 0
    assert app(["log", "export", str(out), "--to", "parquet"], result_action="return_value") == 0
    return out


def rows(folder: Path, query: str) -> list[tuple[Any, ...]]:
    return duckdb.sql(query.replace("@", f"{folder}/tables/")).fetchall()


def test_a_loaded_result_is_what_simulate_returned(folder: Path) -> None:
    loaded, run = fanet_mw.load_result(folder), fanet_mw.simulate("quick")
    same = set(run.summary) - {"wall_s", "files"}
    assert {key: loaded.summary[key] for key in same} == {key: run.summary[key] for key in same}
    assert loaded.trace == run.trace
    assert loaded.deliveries == run.deliveries
    assert loaded.reports == json.loads(json.dumps(run.reports))
    assert [row[:4] for row in loaded.outcome.links.rows()] == [row[:4] for row in run.outcome.links.rows()]
    assert len(loaded.outcome.records) == len(run.outcome.records)
    assert (loaded.outcome.simulated_ns, loaded.outcome.mode) == (run.outcome.simulated_ns, "virtual")
    assert sum(len(frames) for _, frames in loaded.outcome.taps) == sum(len(frames) for _, frames in run.outcome.taps)
    assert {t_ns // US for t_ns, _ in loaded.outcome.taps} == {t_ns // US for t_ns, _ in run.outcome.taps}
    with pytest.raises(ConfigError, match=r"summary\.json"):
        fanet_mw.load_result(folder / "tables")


def test_tables_count_what_the_summary_counts(folder: Path) -> None:
    summary = RunFolder(folder).summary
    [(wanted,)] = rows(folder, "select sum(targets) from '@packets.parquet' where app = 'traffic'")
    [(delivered, p50, longest)] = rows(
        folder,
        "select count(*), quantile_cont(delay_ms, 0.5), max(delay_ms) from '@deliveries.parquet' "
        "where app = 'traffic' and counts",
    )
    assert (delivered, delivered / wanted) == (summary["delivered"], summary["pdr"])
    assert longest == pytest.approx(summary["delay_ms"]["max"], abs=1e-3)
    assert p50 == pytest.approx(summary["delay_ms"]["p50"], abs=1e-3)
    reports = rows(folder, "select count(*) from '@deliveries.parquet' where app = 'report' and counts")
    assert reports == [(summary["reports"]["delivered"],)]
    assert rows(folder, "select count(*) from '@deliveries.parquet' where node = origin and counts") == [(0,)]


def test_tables_have_each_record_once(folder: Path) -> None:
    records = list(RunFolder(folder).records())
    posed = [(one.t_ns / S, *one[1:]) for one in records if isinstance(one, Posed)]
    assert rows(folder, "select * from '@positions.parquet'") == posed
    heard = [(one.t_ns / S, one.node, one.survivor, one.rssi_dbm) for one in records if isinstance(one, Detected)]
    assert rows(folder, "select t_s, node, survivor, rssi_dbm from '@events.parquet' where kind = 'detected'") == heard
    roles = [(one.node, one.role, one.cluster, one.head) for one in records if isinstance(one, RoleChanged)]
    assert rows(folder, "select node, role, cluster, head from '@events.parquet' where kind = 'role_changed'") == roles
    assert rows(folder, "select count(*) from '@drops.parquet'") == [(sum(isinstance(r, Dropped) for r in records),)]
    counts = [rows(folder, f"select count(*) from '@{name}.parquet'")[0][0] for name in tables.TABLES]
    stated = {"let_out", "bound_stated", "bound_excludes", "likely_stated"}  # columns of the packets
    trace = (folder / "trace.jsonl").read_text().splitlines()
    apart = sum(json.loads(line)[0] in stated for line in trace)
    assert sum(counts[:5]) + apart == len(records)


def test_duckdb_and_we_name_the_same_worst_link(folder: Path) -> None:
    def key(link: Any) -> tuple[float, int, int]:
        return link["received"] / link["copies"], link["src"], link["dst"]

    ours = min((link for link in RunFolder(folder).links() if link["copies"] >= 20), key=key)
    [(src, dst, share)] = rows(
        folder,
        "select src, dst, received_share from '@links.parquet' where copies >= 20 order by received_share, src, dst "
        "limit 1",
    )
    assert (src, dst, share) == (ours["src"], ours["dst"], ours["received"] / ours["copies"])
    assert share < 1
    sums = rows(folder, "select sum(copies - received - lost_collision - lost_half_duplex) from '@links.parquet'")
    assert sums == [(0,)]


def test_frames_are_those_of_the_ledger_and_of_the_links(folder: Path) -> None:
    frames = RunFolder(folder).summary["frames"]
    [(sent,)] = rows(folder, "select count(*) from '@frames.parquet' where what = 'sent' and attempt = 1")
    assert sent in (frames["sent"], frames["sent"] - 1)  # one may be in flight at the end
    heard = rows(
        folder, "select src, station, count(*) from '@frames.parquet' where what = 'received' group by all order by all"
    )
    links = RunFolder(folder).links()
    assert heard == sorted((one["src"], one["dst"], one["received"]) for one in links)
    assert rows(folder, "select min(t_s) >= 0, max(t_s) <= 20 from '@frames.parquet'") == [(True, True)]


def test_csv_has_the_same_rows(folder: Path, tmp_path: Path) -> None:
    assert app(["log", "export", str(folder), "--to", "csv", "--out", str(tmp_path)], result_action="return_value") == 0
    for name in tables.TABLES:
        packed = pd.read_parquet(folder / "tables" / f"{name}.parquet")
        text = pd.read_csv(tmp_path / f"{name}.csv")
        assert list(text.columns) == list(packed.columns)
        assert len(text) == len(packed)
    assert pd.read_csv(tmp_path / "positions.csv").east_m.sum() == pytest.approx(
        pd.read_parquet(folder / "tables" / "positions.parquet").east_m.sum()
    )


def decoded(path: Path, *topics: str) -> list[tuple[str, int, Any]]:
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = reader.iter_decoded_messages(topics=topics or None)
        return [(channel.topic, message.log_time - EPOCH_UNIX_NS, content) for _, channel, message, content in found]


def test_a_recording_is_read_back_by_mcap_with_foxgloves_schemas(folder: Path) -> None:
    path = folder / "run.mcap"
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    schemas = {channel.topic: summary.schemas[channel.schema_id] for channel in summary.channels.values()}
    for topic, kind in {
        "/tf": FrameTransforms_pb2.FrameTransforms,
        "/poses": PosesInFrame_pb2.PosesInFrame,
        "/log": Log_pb2.Log,
        **{f"/scene/{name}": SceneUpdate_pb2.SceneUpdate for name in ("world", "uavs", "links", "finds")},
    }.items():
        assert (schemas[topic].name, schemas[topic].encoding) == (kind.DESCRIPTOR.full_name, "protobuf")
    assert {channel.message_encoding for channel in summary.channels.values()} == {"protobuf"}
    places = {(t_ns, pose) for _, t_ns, message in decoded(path, "/poses") for pose in range(len(message.poses))}
    assert len(places) == 201 * 9


def test_every_message_is_whole_by_foxgloves_own_classes_and_the_schema_in_the_file_is_theirs(folder: Path) -> None:
    kinds = {
        kind.DESCRIPTOR.full_name: kind
        for kind in (
            FrameTransforms_pb2.FrameTransforms, PosesInFrame_pb2.PosesInFrame, LocationFix_pb2.LocationFix,
            Log_pb2.Log, SceneUpdate_pb2.SceneUpdate,
        )
    }  # fmt: skip
    seen: Counter[str] = Counter()
    with (folder / "run.mcap").open("rb") as file:
        for schema, _, message in make_reader(file).iter_messages():
            assert schema is not None
            kind = kinds.get(schema.name)
            if kind is None:
                assert schema.name.startswith("fanet.")
                continue
            read = kind.FromString(message.data)
            assert not list(unknown_fields.UnknownFieldSet(read)), "no field that they do not know"
            assert read.SerializeToString(deterministic=True) == message.data
            if not seen[schema.name]:
                described = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
                own = descriptor_pb2.FileDescriptorProto()
                kind.DESCRIPTOR.file.CopyToProto(own)
                assert own.message_type[0] in [one.message_type[0] for one in described.file if one.message_type]
            seen[schema.name] += 1
    assert seen.keys() == kinds.keys()


def test_the_layout_shows_topics_and_fields_that_a_recording_has(folder: Path) -> None:
    layout = json.loads((ROOT / "sim" / "recording" / "foxglove-layout.json").read_text())
    panels = layout["configById"]
    found = {topic: message for topic, _, message in decoded(folder / "run.mcap")}
    paths = [line["value"] for panel in panels.values() for line in panel.get("paths", ())]
    assert len(paths) >= 5
    for path in paths:
        topic, _, field = path.partition(".")
        assert field in found[topic].DESCRIPTOR.fields_by_name, path
    scenes = panels["3D!swarm"]["topics"]
    assert {topic for topic in found if topic.startswith("/scene/")} == scenes.keys()
    assert panels["RosOut!log"]["topicToRender"] in found
    named = re.findall(r'"(?:first|second)": "([^"]+)"', json.dumps(layout["layout"]))
    assert set(named) == panels.keys()


def test_a_recording_has_the_positions_links_and_events_of_the_run(folder: Path) -> None:
    path, run = folder / "run.mcap", RunFolder(folder)
    at = {(one.t_ns, one.node): one[2:] for one in run.records(Posed)}
    seen = 0
    for _, t_ns, message in decoded(path, "/tf"):
        for one in message.transforms:
            known = at.get((t_ns, int(one.child_frame_id.removeprefix("uav-"))))
            if known is not None:
                seen += 1
                moved = (one.translation.x, one.translation.y, one.translation.z)
                assert moved == pytest.approx(known, abs=0.006)  # the trace has centimetres
    assert seen == len(at)
    carried: dict[tuple[int, int], list[int]] = {}
    for _, _, message in decoded(path, "/links"):
        for link in message.links:
            sums = carried.setdefault((link.src, link.dst), [0, 0])
            sums[0] += link.copies
            sums[1] += link.received
    assert carried == {(one["src"], one["dst"]): [one["copies"], one["received"]] for one in run.links()}
    said = [message.message for _, _, message in decoded(path, "/log")]
    heard = list(run.records(Detected))
    assert [text for text in said if "hears the phone" in text] == [
        f"{one.t_ns / S:.1f} s: UAV {one.node} hears the phone of survivor {one.survivor}" for one in heard
    ]
    last = decoded(path, "/metrics")[-1][2]
    assert last.coverage_share == pytest.approx(run.summary["mission"]["coverage"], abs=0.02)
    assert last.airtime_share == run.summary["air"]["busy"]


def test_an_observer_changes_nothing_and_sees_the_same_run_twice(tmp_path: Path) -> None:
    scenario = catalog.find("quick", ["duration_s=7", "drain_s=1"])
    plain = simulate(scenario)
    (tmp_path / "b").write_bytes(b"an earlier flight")
    for name in ("a", "b"):
        with McapRecording(tmp_path / name, scenario, epoch_unix_ns=EPOCH_UNIX_NS) as recording:
            assert list(simulate(scenario, observer=recording).records) == list(plain.records)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_recording_that_is_being_written_is_no_other_runs_even_by_force(tmp_path: Path) -> None:
    path = tmp_path / "one.mcap"
    scenario = catalog.find("quick", ["duration_s=2", "warmup_s=0", "drain_s=1"])
    with McapRecording(path, scenario, epoch_unix_ns=EPOCH_UNIX_NS) as recording:
        simulate(scenario, observer=recording)
        recording._file.flush()
        before = path.read_bytes()
        with pytest.raises(ConfigError, match=r"--record .*one.mcap: another run records there now"):
            app(["simulate", "quick", "--record", str(path), "--force"], result_action="return_value")
        assert path.read_bytes() == before
    assert path.read_bytes().startswith(before)


UNMADE = """
from fanet_mw.routing.flooding import Flooding
class Unmade(Flooding):
    def __init__(self, port): raise ValueError
class Unstarted(Flooding):
    def start(self, now_ns): raise ValueError
class Unready(Flooding):
    def next_wake_ns(self): return 0
    def wake(self, now_ns): raise ValueError
"""


@pytest.mark.parametrize("part", ["Unmade", "Unstarted", "Unready"])
def test_an_earlier_recording_stays_when_a_run_fails_at_its_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    (tmp_path / "unmade.py").write_text(UNMADE)
    monkeypatch.syspath_prepend(tmp_path)
    old, new = tmp_path / "old.mcap", tmp_path / "new.mcap"
    old.write_bytes(b"an hour of flight")
    for path in (old, new):
        words = ["simulate", "quick", "--record", str(path), "--force", "--set", f"routing.protocol=unmade:{part}"]
        with pytest.raises((ConfigError, ValueError)):
            app(words, result_action="return_value")
    assert old.read_bytes() == b"an hour of flight"
    assert not new.exists()


@pytest.mark.parametrize(("replaced", "why"), [(False, "No such file"), (True, "another file has taken its place")])
def test_a_recording_that_somebody_removes_meanwhile_ends_early_and_says_so(
    tmp_path: Path, replaced: bool, why: str
) -> None:
    path = tmp_path / "one.mcap"
    with McapRecording(path, catalog.find("quick"), epoch_unix_ns=EPOCH_UNIX_NS) as recording:
        path.unlink()
        if replaced:
            path.write_bytes(b"mine")
    assert recording.failure is not None
    assert why in recording.failure
    assert not replaced or path.read_bytes() == b"mine"


def test_a_finished_run_becomes_a_recording(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "later.mcap"
    assert app(["log", "export", str(folder), "--to", "mcap", "--out", str(path)], result_action="return_value") == 0
    posed = {(one.t_ns, one.node): one[2:] for one in RunFolder(folder).records(Posed)}
    found = {
        (t_ns, int(one.child_frame_id.removeprefix("uav-"))): (one.translation.x, one.translation.y, one.translation.z)
        for _, t_ns, message in decoded(path, "/tf")
        for one in message.transforms
    }
    assert found == posed


def test_a_gpx_per_uav_and_a_kml_have_the_tracks_on_earth(folder: Path, tmp_path: Path) -> None:
    run = RunFolder(folder)
    origin = Geodetic(*run.scenario.world.origin_deg, 0.0)
    posed = [one for one in run.records(Posed) if one.node == 3]
    for to, out in (("gpx", tmp_path / "tracks"), ("kml", tmp_path / "all.kml")):
        words = ["log", "export", str(folder), "--to", to, "--out", str(out)]
        assert app(words, result_action="return_value") == 0
    assert sorted(path.name for path in (tmp_path / "tracks").iterdir()) == [f"uav-{node}.gpx" for node in range(1, 10)]
    gpx = "{http://www.topografix.com/GPX/1/1}"
    points = ElementTree.parse(tmp_path / "tracks" / "uav-3.gpx").getroot().findall(f"{gpx}trk/{gpx}trkseg/{gpx}trkpt")
    assert len(points) == len(posed)
    for point, one in zip(points, posed, strict=True):
        place = Geodetic(float(point.attrib["lat"]), float(point.attrib["lon"]), 0.0)
        assert to_enu(place, origin)[:2] == pytest.approx((one.east_m, one.north_m), abs=0.02)
        assert float(point.findtext(f"{gpx}ele", "nan")) == one.up_m
    assert points[5].findtext(f"{gpx}time") == "2025-01-01T00:00:05.000Z"
    kml = "{http://www.opengis.net/kml/2.2}"
    tracks = list(ElementTree.parse(tmp_path / "all.kml").getroot().iter("{http://www.google.com/kml/ext/2.2}Track"))
    assert len(tracks) == 9
    coords = [one.text for one in tracks[2].findall("{http://www.google.com/kml/ext/2.2}coord")]
    assert len(coords) == len(tracks[2].findall(f"{kml}when")) == len(posed)
    lon, lat, up = map(float, str(coords[7]).split())
    assert (lat, lon) == (float(points[7].attrib["lat"]), float(points[7].attrib["lon"]))
    assert up == posed[7].up_m


@pytest.mark.parametrize("to", ["parquet", *slow("mcap", "csv", "gpx", "kml")])
def test_an_export_that_does_not_fit_leaves_no_file_that_is_cut(folder: Path, tmp_path: Path, to: str) -> None:
    """A table that ends early looks like one that is whole; files may have 1 KiB here."""
    done = subprocess.run(
        ["bash", "-c", f"ulimit -f 1; exec {sys.executable} -m fanet_mw log export {folder} --to {to} --out out"],
        cwd=tmp_path, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"fanet: out(/[a-z]+(-1)?\.[a-z]+)?: cannot be written: File too large\n", done.stderr)
    assert [path for path in tmp_path.rglob("*") if path.is_file() and path.stat().st_size == 1024] == []


@pytest.mark.parametrize(
    ("to", "link", "target"),
    [
        ("csv", "tables", "outside"), ("gpx", "tracks", "outside"), ("kml", "tracks.kml", "outside/x"),
        ("mcap", "recording.mcap", "outside/x"), ("parquet", "tables/drops.parquet", "../../outside/x"),
    ],
)  # fmt: skip
def test_an_export_never_follows_a_link_that_lies_in_the_folder(
    folder: Path, tmp_path: Path, to: str, link: str, target: str
) -> None:
    """The folder may be somebody else's, and the link may lead anywhere."""
    run, outside = Path(shutil.copytree(folder, tmp_path / "run")), tmp_path / "outside"
    shutil.rmtree(run / "tables")
    outside.mkdir()
    (outside / "x").write_text("untouched")
    (run / link).parent.mkdir(exist_ok=True)
    (run / link).symlink_to(tmp_path / target if "/" not in link else target)
    with contextlib.suppress(ConfigError):
        app(["log", "export", str(run), "--to", to, "--force"], result_action="return_value", exit_on_error=False)
    assert {path.name: path.read_text() for path in outside.iterdir()} == {"x": "untouched"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["export", "@", "--to", "xml"], "--to xml: must be one of parquet, csv, mcap, gpx, kml"),
        (["export", "@", "--to", "parquet"], "tables: exists"),
        (["export", "/nowhere", "--to", "csv"], "summary.json"),
        (["info", "@/trace.jsonl"], "summary.json"),
        (["info", "@/broken.mcap"], "is no whole MCAP file"),
        (["info", "@/cut.mcap"], "it was cut off, and has no index; mcap recover makes one"),
    ],
)
def test_what_cannot_be_exported_is_said(folder: Path, words: list[str], message: str) -> None:
    (folder / "broken.mcap").write_bytes(b"no recording" * 10)
    (folder / "cut.mcap").write_bytes(b"\x89MCAP0\r\n" + b"a recording" * 10)
    with pytest.raises(ConfigError, match=re.escape(message)):
        app(
            ["log", *(word.replace("@", str(folder)) for word in words)],
            result_action="return_value",
            exit_on_error=False,
        )


def test_a_recording_of_another_program_is_shown_and_moves_no_cursor(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its channel has no schema, as MCAP allows, and its name would clear the screen."""
    with (tmp_path / "other.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel(topic="/\x1b[2J[bold]", message_encoding="json", schema_id=0)
        writer.add_message(channel, log_time=1, data=b"{}", publish_time=1)
        writer.finish()
    assert app(["log", "info", str(tmp_path / "other.mcap")], result_action="return_value") == 0
    assert capsys.readouterr().out.splitlines()[-1].split() == ["/\\x1b[2J[bold]", "1"]


def test_a_pipe_is_no_recording_and_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mcap")
    for words in (("log", "info"), ("record", "--force"), ("simulate", "quick", "--force", "--record")):
        with pytest.raises(ConfigError, match="not a regular file"):
            app([*words, str(tmp_path / "pipe.mcap")], result_action="return_value", exit_on_error=False)


@pytest.mark.parametrize(
    ("path", "message"), [("run.txt", r"must be a file whose name ends in \.mcap"), ("is.mcap", "exists")]
)
def test_a_recording_that_cannot_be_written_is_said_before_the_run(tmp_path: Path, path: str, message: str) -> None:
    (tmp_path / "is.mcap").write_bytes(b"x")
    with pytest.raises(ConfigError, match=message):
        app(["simulate", "quick", "--record", str(tmp_path / path)], result_action="return_value", exit_on_error=False)


@pytest.mark.slow
def test_a_recording_that_ends_early_costs_no_result(tmp_path: Path) -> None:
    """The file may have 8 KiB: the recording says why it ends there, and the summary names it."""
    flown = "simulate quick --json --record x.mcap --set duration_s=5 warmup_s=2 drain_s=1 nodes.count=4"
    done = subprocess.run(
        ["bash", "-c", f"ulimit -f 8; exec {sys.executable} -m fanet_mw {flown}"],
        cwd=tmp_path, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    said = json.loads(done.stdout)
    assert (said["valid"], said["unwritten"]) == (False, {"x.mcap": "File too large"})
    assert said["pdr"] > 0.9
    assert done.stderr.splitlines()[-1] == "x.mcap: the recording ends here: File too large"
    assert done.returncode == 1


def test_info_names_kinds_and_topics(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path, words in ((folder, ("delivered", "valid", "posed")), (folder / "run.mcap", ("/tf", "foxglove.Log"))):
        assert app(["log", "info", str(path)], result_action="return_value") == 0
        said = capsys.readouterr().out
        assert all(word in said for word in words)


def test_the_page_names_every_column_and_every_topic(folder: Path) -> None:
    text = PAGE.read_text()
    for name, table in tables.TABLES.items():
        [row] = re.findall(rf"^\| `{name}` \| .* \| (.*) \|$", text, re.MULTILINE)
        outside = re.sub(r"\([^()]*\)", "", row)
        assert re.findall(r"`(\w+)`", outside) == table.schema.names
    topics = {re.sub(r"/\d+/", "/N/", topic) for topic, _, _ in decoded(folder / "run.mcap")}
    assert set(re.findall(r"^\| `(/\S+)` \|", text, re.MULTILINE)) == topics


def test_the_programs_of_the_page_run(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder.parents[1])
    if not Path("runs").exists():
        Path("runs").symlink_to(folder.parent)
    names: dict[str, object] = {}
    programs = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    for program in programs:
        exec(program, names)
    said = capsys.readouterr().out
    assert len(programs) == 3
    assert "received_share" in said
    assert "1.0 " in said


@pytest.mark.slow
def test_the_notebook_of_tables_runs() -> None:
    notebook = nbformat.read(ROOT / "examples" / "run" / "tables.ipynb", as_version=4)
    names: dict[str, Any] = {}
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert not cell.outputs
            exec(cell.source, names)
    assert len(names["worst"]) == 5
    assert (names["by_origin"].delivered > 0.9).all()
    assert len(names["found"]) == 3
