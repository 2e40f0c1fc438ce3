"""Folders of results that somebody else has made: what is in them is believed only as far as it can be checked."""

import json
import math
import os
import shutil
import time
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fanet_mw.errors import ConfigError
from sim.cli.out_folder import OutFolder
from sim.report import page, replay_page
from sim.results.files import begin, finish
from sim.results.replay import Replay
from sim.results.result import load_result
from sim.results.run_folder import RunFolder, holds_run
from sim.results.run_table import read
from sim.run.virtual import simulate
from sim.scenarios import catalog


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "run"
    finish(simulate(catalog.find("quick", ["duration_s=6", "warmup_s=3", "drain_s=1"])), out=folder)
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A copy that may be changed, three levels deep, beside a file that is nobody's business."""
    (tmp_path / "foreign").write_text("untouched")
    return Path(shutil.copytree(made, tmp_path / "a" / "b" / "run"))


def change(folder: Path, **keys: Any) -> None:
    """Change keys of the summary; a dot in a key leads into a table."""
    path = folder / "summary.json"
    summary = json.loads(path.read_text())
    for key, value in keys.items():
        *tables, last = key.split("__")
        table = summary
        for name in tables:
            table = table[name]
        table[last] = value
    path.write_text(json.dumps(summary))


def forge(folder: Path, name: str, content: bytes) -> None:
    """Change a file and what the summary says of it."""
    (folder / name).write_bytes(content)
    entry = {"bytes": len(content), "sha256": sha256(content).hexdigest()}
    summary = json.loads((folder / "summary.json").read_text())
    change(folder, files={**summary["files"], name: entry})


def everything(root: Path) -> dict[str, int]:
    return {str(path.relative_to(root)): path.lstat().st_mtime_ns for path in sorted(root.rglob("*"))}


def refused(folder: Path, *, by: Callable[[Path], Any]) -> str:
    """Reading ends at once with one short line, and touches nothing."""
    root = folder.parents[2]
    before, began = everything(root), time.monotonic()
    with pytest.raises(ConfigError) as error:
        by(folder)
    assert time.monotonic() - began < 5
    after = everything(root)
    pictures = str((folder / "pictures").relative_to(root))
    assert {*after} - {pictures} == {*before} - {pictures}
    text = str(error.value)
    assert len(text) < 600
    assert "\n" not in text
    return text


def report(folder: Path) -> None:
    page.write([folder], folder)


def test_a_table_whose_columns_have_no_names_is_refused(tmp_path: Path) -> None:
    pq.write_table(pa.table({"abcdefgh": [1]}), tmp_path / "runs.parquet")
    whole = (tmp_path / "runs.parquet").read_bytes()
    (tmp_path / "runs.parquet").write_bytes(whole.replace(b"abcdefgh", b"abc\x8befgh"))
    with pytest.raises(ConfigError, match="can't decode byte 0x8b"):
        read(tmp_path)


def test_a_folder_of_ones_own_makes_a_page_a_replay_and_a_row(folder: Path) -> None:
    report(folder)
    assert "The result may be used." in (folder / "report.md").read_text()
    replay_page.write(Replay.read(folder), folder / "replay.html")
    assert read(folder).num_rows == 1


def test_a_folder_whose_name_is_no_text_has_a_page(folder: Path) -> None:
    odd = folder.rename(folder.with_name("r\udcff"))
    report(odd)
    assert "r\\udcff" in (odd / "report.html").read_text()


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"scenario": "../../PWN"}, "scenario = "),
        ({"scenario": "/tmp/PWN"}, "scenario = "),
        ({"scenario": "other"}, "is of another run"),
        ({"seed": "../1"}, "seed = "),
        ({"seed": -1}, "seed = "),
        ({"seed": 2}, "is of another run"),
        ({"nodes": 10**9}, "is of another run"),
        ({"valid": "no"}, "valid = 'no'"),
        ({"valid": 1}, "valid = 1"),
        ({"valid": False}, "contradicts invalid_because"),
        ({"invalid_because": ["a"]}, "contradicts invalid_because"),
        ({"unwritten": {"trace.jsonl": "full"}}, "contradicts"),
        ({"simulated_s": "long"}, "simulated_s = 'long'"),
        ({"epoch_unix_ns": -1}, "epoch_unix_ns = -1"),
        ({"pdr": math.nan}, "nan, which must be finite"),
        ({"pdr": 1.5}, "pdr = 1.5"),
        ({"pdr": "x" * 100_000}, "pdr = "),
        ({"delay_ms": []}, "delay_ms = "),
        ({"delay_ms__p50": math.inf}, "inf, which must be finite"),
        ({"mission": None}, "mission = "),
        ({"mission__nearest_m": 7}, "nearest_m"),
        ({"mission__cut_vertices": "many"}, "cut_vertices"),
        ({"mission__diameter": {"p50": "a", "most": 3}}, "diameter"),
        ({"mission__photographed": "x"}, "photographed"),
        ({"mission__connected": 1.0, "mission__biconnected": 7}, "biconnected"),
        ({"files": {}}, "does not say that it was written"),
        ({"files": {"trace.jsonl": 1}}, "files"),
        ({"invalid_because": {}}, "invalid_because"),
        ({"mode": "dreamt"}, "mode = 'dreamt'"),
        ({"air": 1}, "air = 1"),
        ({"seed": 10**30}, "an integer of 100 bits"),
    ],
)
def test_a_summary_with_a_wrong_value_is_named(folder: Path, keys: dict[str, Any], said: str) -> None:
    change(folder, **keys)
    assert said in refused(folder, by=report)


NONE = (b"", b"[]", b"null", b"1", b'"text"', b"{", b"\xff\xfe", b"[" * 100_000, b'{"a":' * 5_000, b"9" * 5_000, b"{}")
EMPTY = (("reports.json", b"{}"), ("links.json", b"[]"))
"""Nobody has reported."""


@pytest.mark.parametrize(
    ("name", "content"),
    [
        (name, content)
        for name in ("summary.json", "scenario.toml", "reports.json", "links.json")
        for content in NONE
        if (name, content) not in EMPTY
    ],
)
def test_content_that_is_none_is_one_line(folder: Path, name: str, content: bytes) -> None:
    if name == "summary.json":
        (folder / name).write_bytes(content)
    else:
        forge(folder, name, content)
    refused(folder, by=report)


@pytest.mark.slow
def test_a_run_of_which_nobody_has_reported_has_a_page(folder: Path) -> None:
    for name, content in EMPTY:
        forge(folder, name, content)
    report(folder)
    assert "The result may be used." in (folder / "report.md").read_text()


@pytest.mark.parametrize(
    "change", [{"src": 70_000}, {"dst": 0}, {"received": 2**53}, {"lost": "all"}, {"rssi_dbm": 1e300}], ids=str
)
def test_a_link_that_cannot_be_is_named(folder: Path, change: dict[str, Any]) -> None:
    links = json.loads((folder / "links.json").read_text())
    forge(folder, "links.json", json.dumps([{**links[0], **change}, *links[1:]]).encode())
    assert f"links.json: 0.{next(iter(change))}" in refused(folder, by=lambda where: load_result(where).outcome)


@pytest.mark.parametrize("by", [report, Replay.read])
@pytest.mark.parametrize("keep", [0, 0.3, 1.01])
def test_a_trace_of_another_length_or_content_is_not_the_runs(folder: Path, by: Any, keep: float) -> None:
    whole = (folder / "trace.jsonl").read_bytes()
    (folder / "trace.jsonl").write_bytes((whole * 2)[: int(len(whole) * keep)])
    assert "trace.jsonl: is not the file that was written" in refused(folder, by=by)
    (folder / "trace.jsonl").write_bytes(whole.replace(b"3", b"4", 1))
    refused(folder, by=by)


@pytest.mark.parametrize(
    "line",
    [
        b'["delivered",1,1,2,1,1,1]\n', b'["posed",1000000000,99,0.0,0.0,0.0]\n',
        b'["posed",1000000000,1,1e300,0.0,0.0]\n',
        b'["posed",9000000000000000000,1,0.0,0.0,0.0]\n', b'["detected",1000000000,1,99,-60.0]\n',
        b"[" * 3_000 + b"\n", b"x" * 100_000 + b"\n", b'["posed",1,1,NaN,0.0,0.0]\n',
    ],
)  # fmt: skip
def test_a_record_that_the_run_cannot_have_made_is_named_by_its_line(folder: Path, line: bytes) -> None:
    whole = (folder / "trace.jsonl").read_bytes()
    forge(folder, "trace.jsonl", line + whole)
    assert "trace.jsonl, line 1: " in refused(folder, by=report)


@pytest.mark.parametrize("name", ["summary.json", "scenario.toml", "reports.json", "links.json", "trace.jsonl"])
@pytest.mark.parametrize("kind", ["link", "pipe", "folder", "device"])
def test_what_is_no_regular_file_of_the_folder_is_not_read(folder: Path, name: str, kind: str) -> None:
    path = folder / name
    elsewhere = folder.parent / "elsewhere"
    path.rename(elsewhere)
    match kind:
        case "link":
            path.symlink_to(elsewhere)
        case "pipe":
            os.mkfifo(path)
        case "folder":
            path.mkdir()
        case "device":
            path.symlink_to("/dev/zero")
    assert "not a regular file" in refused(folder, by=report)


def test_pages_and_pictures_replace_links_and_never_go_through_them(folder: Path) -> None:
    foreign = folder.parents[2] / "foreign"
    (folder / "pictures").mkdir()
    for name in ("report.html", "report.md", "pictures/quick-1-links.png", "pictures/quick-1-delays.svg"):
        (folder / name).symlink_to(foreign)
    report(folder)
    assert foreign.read_text() == "untouched"
    assert not (folder / "report.md").is_symlink()
    shutil.rmtree(folder / "pictures")
    (folder / "pictures").symlink_to(folder.parent)
    refused(folder, by=report)
    assert {path.name for path in folder.parent.iterdir()} == {"run"}


def test_force_removes_nothing_behind_a_link(tmp_path: Path) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    out.mkdir()
    elsewhere.mkdir()
    (elsewhere / "quick-1-links.png").write_text("mine")
    (out / "pictures").symlink_to(elsewhere)
    (out / "trace.jsonl").symlink_to(tmp_path / "nothing")
    with pytest.raises(ConfigError, match=r"trace\.jsonl"):
        OutFolder(out, force=False)
    folder = OutFolder(out, force=True)
    folder.start()
    folder.replace()
    assert (elsewhere / "quick-1-links.png").exists()
    assert not os.path.lexists(out / "trace.jsonl")


def test_nothing_that_a_folder_names_is_imported(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = folder.parent / "hostile_part.py"
    module.write_text(f"open({str(folder.parents[2] / 'foreign')!r}, 'w').write('imported')\nclass Part: pass\n")
    monkeypatch.syspath_prepend(str(folder.parent))
    text = (folder / "scenario.toml").read_text()
    for old, new in (
        ('protocol = "clustered"', 'protocol = "hostile_part:Part"'),
        ('model = "static"', 'model = "hostile_part:Part"'),
        ('channel = "range"', 'channel = "hostile_part:Part"'),
        ('method = "balanced"', 'method = "hostile_part:Part"'),
        ("applications = []", 'applications = [{use = "hostile_part:Part"}]'),
    ):
        if old in text:
            forge(folder, "scenario.toml", text.replace(old, new).encode())
            Replay.read(folder)
    assert old in text
    assert (folder.parents[2] / "foreign").read_text() == "untouched"


def test_a_run_of_before_keys_were_removed_is_read_if_they_had_no_effect_in_it(folder: Path) -> None:
    text = (folder / "scenario.toml").read_text()
    old = text.replace("[clusters]", "[clusters]\nslots = 0\ngossip_degree = 6.0").replace(
        "[mission]", "[mission]\ncoverage_map = false"
    )
    assert old.count("slots = 0") == old.count("coverage_map = false") == 1
    forge(folder, "scenario.toml", old.encode())
    Replay.read(folder)
    forge(folder, "scenario.toml", old.replace("slots = 0", "slots = 8").encode())
    with pytest.raises(ConfigError, match=r"clusters\.slots: removed"):
        Replay.read(folder)


@pytest.mark.slow
def test_a_description_is_text_in_every_page(folder: Path) -> None:
    hostile = (
        "x</p><script>alert(1)</script>\n# A heading\n[a](javascript:alert(3)) ![p](http://127.0.0.1/b) | a |\n- b `c`"
    )
    text = (folder / "scenario.toml").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("description")]
    forge(folder, "scenario.toml", "\n".join([f"description = {json.dumps(hostile)}", *lines]).encode())
    report(folder)
    markdown, html = (folder / "report.md").read_text(), (folder / "report.html").read_text()
    for page_text in (markdown, html):
        assert "<script" not in page_text
    assert "\n# A heading" not in markdown
    assert "](javascript" not in markdown
    assert "http://" not in markdown
    assert "\\`c\\`" in markdown


def test_a_run_that_has_only_begun_is_one_that_did_not_end(tmp_path: Path) -> None:
    begin(tmp_path)
    assert holds_run(tmp_path)
    with pytest.raises(ConfigError, match="the run did not end"):
        RunFolder(tmp_path)
