"""The dialect: the module is what the XML gives, the XML stands beside common.xml, and the document says the same."""

import importlib.util
import re
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from pymavlink.dialects.v20 import common
from pymavlink.generator import mavgen, mavparse

from fanet_mw import wire
from fanet_mw.dialect import fanet

ROOT = Path(__file__).resolve().parents[3]
DIALECT = ROOT / "fanet_mw" / "dialect"
_PAGES = ("air-format.md", "air-messages.md", "air-messages-clusters.md", "air-messages-search.md")
DOCUMENT = "\n".join((ROOT / "docs" / "reference" / page).read_text(encoding="utf-8") for page in _PAGES)


def load(path: Path, name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def generate() -> Callable[..., int]:
    main: Callable[..., int] = load(ROOT / "scripts" / "generate_dialect.py", "generate_dialect").main
    return main


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for name in ("fanet.xml", "fanet.py"):
        shutil.copy(DIALECT / name, tmp_path)
    return tmp_path


def edit(path: Path, *, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


# --- the script ---------------------------------------------------------------------------------------------------


def test_the_module_checked_in_is_what_the_xml_gives(generate: Callable[..., int]) -> None:
    assert generate(["--check"]) == 0


def test_a_changed_xml_fails_the_check_until_the_module_is_generated_again(
    generate: Callable[..., int], copy: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(copy / "fanet.xml", old='name="reporter"', new='name="witness"')
    assert generate(["--check"], dialect=copy) == 1
    said = capsys.readouterr().err
    assert "run scripts/generate_dialect.py" in said
    assert "witness" in said
    assert generate([], dialect=copy) == 0
    assert generate(["--check"], dialect=copy) == 0
    changed = load(copy / "fanet.py", "changed")
    assert changed.MAVLink_fanet_survivor_message.crc_extra != wire.SURVIVOR.crc_extra


def test_a_module_edited_by_hand_or_missing_fails_the_check(generate: Callable[..., int], copy: Path) -> None:
    edit(copy / "fanet.py", old="crc_extra = 34", new="crc_extra = 35")
    assert generate(["--check"], dialect=copy) == 1
    (copy / "fanet.py").unlink()
    assert generate(["--check"], dialect=copy) == 1


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("  <include>common.xml</include>\n", ""),
        ("</mavlink>", ""),
        ('type="uint64_t" name="t_us"', 'type="uint63_t" name="t_us"'),
        ('id="53006"', 'id="53005"'),
        ('units="dBm"', 'units="decibel"'),
    ],
    ids=["no include", "not closed", "no such type", "id twice", "no such unit"],
)
def test_a_wrong_xml_is_one_sentence_and_leaves_the_module_alone(
    generate: Callable[..., int], copy: Path, capsys: pytest.CaptureFixture[str], old: str, new: str
) -> None:
    before = (copy / "fanet.py").read_bytes()
    edit(copy / "fanet.xml", old=old, new=new)
    assert generate([], dialect=copy) == 1
    assert str(copy / "fanet.xml") in capsys.readouterr().err
    assert (copy / "fanet.py").read_bytes() == before


def test_an_unknown_flag_does_not_overwrite_the_module(generate: Callable[..., int], copy: Path) -> None:
    (copy / "fanet.py").unlink()
    assert generate(["--chekc"], dialect=copy) == 2
    assert not (copy / "fanet.py").exists()


# --- the XML as other people's tools use it -----------------------------------------------------------------------


def test_the_shipped_xml_with_its_include_makes_a_dialect_that_reads_the_air(tmp_path: Path) -> None:
    theirs = Path(common.__file__).parent
    for path in (theirs / "common.xml", theirs / "standard.xml", theirs / "minimal.xml", DIALECT / "fanet.xml"):
        shutil.copy(path, tmp_path)
    options = mavgen.Opts(
        str(tmp_path / "full.py"), wire_protocol=mavparse.PROTOCOL_2_0, language="Python3", validate=True
    )
    assert mavgen.mavgen(options, [str(tmp_path / "fanet.xml")])
    full = load(tmp_path / "full.py", "full")
    assert set(full.mavlink_map) == set(common.mavlink_map) | set(fanet.mavlink_map)
    header = wire.Header(12, 1, 3, 0xFFFF, 3, wire.Kind.DATA, 32, 0, 3, 0)
    heard = full.MAVLink(None).parse_buffer(bytearray(header.encode() + wire.filler(40)))
    assert [message.get_type() for message in heard] == ["FANET_ROUTE", "FANET_CHUNK"]


def test_our_ids_are_in_our_range_and_taken_by_nobody_in_common() -> None:
    ours = set(fanet.mavlink_map)
    assert ours == {spec.msgid for spec in wire.SPECS}
    assert ours <= set(range(53_000, 53_100))
    natives = {key for key, message in common.mavlink_map.items() if "fanet" not in message.__name__}
    assert not ours & natives


@pytest.mark.parametrize(
    "spec",
    [spec for spec in wire.SPECS if spec not in (wire.CHUNK, wire.ROUTING, wire.SEARCH, wire.ROLL)],
    ids=lambda spec: str(spec.msgid),
)
def test_the_last_byte_on_the_wire_is_the_version(spec: wire.Spec) -> None:
    assert fanet.mavlink_map[spec.msgid].ordered_fieldnames[-1] == "version"
    assert spec.layout.format[-1] == "B"


# --- the document -------------------------------------------------------------------------------------------------


@pytest.fixture
def generate_tables() -> Callable[..., int]:
    main: Callable[..., int] = load(ROOT / "scripts" / "generate_air_reference.py", "generate_air_reference").main
    return main


def test_the_tables_of_fields_checked_in_are_what_dialect_and_codecs_give(generate_tables: Callable[..., int]) -> None:
    assert generate_tables(["--check"]) == 0


@pytest.mark.parametrize(
    ("old", "new"), [("| 8 | `survivor`", "| 4 | `survivor`"), ("fields: FANET_TIME by", "FANET_TIME by")]
)
def test_a_table_edited_by_hand_or_missing_fails_the_check(
    generate_tables: Callable[..., int], tmp_path: Path, old: str, new: str
) -> None:
    for page in _PAGES:
        shutil.copy(ROOT / "docs" / "reference" / page, tmp_path)
    edit(tmp_path / "air-messages.md", old=old, new=new)
    assert generate_tables(["--check"], folder=tmp_path) == 1


def test_the_document_sums_up_every_message() -> None:
    for spec in wire.SPECS:
        name, frame = fanet.mavlink_map[spec.msgid].msgname, spec.layout.size + wire.OVERHEAD
        least = {"FANET_CHUNK": "17-", "FANET_ROUTING": "17-", "FANET_SEARCH": "57-", "FANET_ROLL": "22-"}
        size = f"{least.get(name, '')}{frame}"
        assert f"| {spec.msgid} | `{name}` | {size} |" in DOCUMENT


def test_the_offsets_of_the_document_are_where_the_header_has_them() -> None:
    header = wire.Header(
        origin_us=0x1122334455667788, seq=0xAABBCCDD, origin=0x0102, destination=0x0304, prev_hop=0x0506,
        kind=0, hop_limit=7, hops=8, priority=9, flags=3,
    )  # fmt: skip
    frame = header.encode()
    assert (frame[:3], frame[7:10]) == (bytes.fromhex("FD 18 00"), bytes.fromhex("08 CF 00"))
    assert frame[4] == 0xDD
    assert (frame[5], frame[6]) == (wire.system_id(0x0506), 191)
    assert struct.unpack_from("<QIH", frame, 10) == (header.origin_us, header.seq, header.origin)
    assert frame[32] == 3
    for said in ("`FD 18 00`", "`08 CF 00`", "`origin_us` at 10, `seq` at 18, `origin` at 22, `flags` at 32"):
        assert said in DOCUMENT
    assert f"{wire.LATEST_US:,} us" in DOCUMENT


def test_every_name_that_is_read_from_common_is_there() -> None:
    """Nothing else looks: pymavlink has no types, and a rare answer may be the only one that reads a name."""
    sources = [path for folder in ("fanet_mw", "agents", "sim") for path in (ROOT / folder).rglob("*.py")]
    read = {
        (name, str(path.relative_to(ROOT)))
        for path in sources
        for name in re.findall(r"\bcommon\.(MAV\w+)", path.read_text(encoding="utf-8"))
    }
    assert len(read) > 100
    assert [use for use in sorted(read) if not hasattr(common, use[0])] == []
