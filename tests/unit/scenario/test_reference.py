"""Every key of a scenario can be looked up, on a page, in a file and in an editor: meaning, unit, bound and default."""

import json
import runpy
import tomllib
from pathlib import Path

import pytest

from fanet_mw.scenario import config
from fanet_mw.scenario.commented import SCHEMA_NAME, commented
from fanet_mw.scenario.reference import KeyTable, bound, dotted_keys, json_schema, tables
from sim.scenarios import catalog

ROOT = Path(__file__).parents[3]
TABLES = {(table.path, table.heading): table for table in tables()}
DIMENSIONLESS = {
    "time_scale", "camera_cycles", "exponent", "phone_exponent", "nakagami_m", "charge", "bulk_share",
    "gps_vertical",
}  # fmt: skip
"""Keys of numbers that are pure: factors, exponents; shares are known by their bound."""


def table(path: str, heading: str = "") -> KeyTable:
    return TABLES[path, heading]


@pytest.mark.parametrize("of", TABLES.values(), ids=lambda of: of.title)
def test_every_key_says_what_it_means_and_every_measure_has_a_unit(of: KeyTable) -> None:
    assert of.meaning
    assert [key.name for key in of.keys if len(key.meaning) < 10] == []
    assert [key.name for key in of.keys if not key.bound or key.bound == "any"] == []
    unitless = {
        key.name
        for key in of.keys
        if not key.unit
        and key.bound != "0 to 1"
        and not key.bound.startswith(("whole", "> 0, < ", '"', "text", "true", "list", "table", "an entry"))
    }
    assert unitless - DIMENSIONLESS == set()


def test_what_is_said_of_a_key_is_what_its_model_holds() -> None:
    lead = next(key for key in table("radio").keys if key.name == "lead_ms")
    assert (lead.unit, lead.bound, lead.default) == ("ms", "0 to 1,000", 20.0)
    shape = next(key for key in table("radio").keys if key.name == "nakagami_m")
    assert shape.unit == ""
    assert table("faults", 'kind = "jam"').repeated
    assert not table("radio").repeated
    assert not table("traffic").repeated, "it may be given once, and then is no array"
    assert bound({"anyOf": [{"const": "all"}, {"type": "integer", "minimum": 0}, {"type": "null"}]}) == (
        '"all"; or whole, >= 0'
    )
    assert "radio.lead_ms" in dotted_keys()
    assert "duration_s" in dotted_keys()


@pytest.mark.parametrize("every_key", [True, False])
@pytest.mark.parametrize("entry", catalog.shipped(), ids=lambda entry: entry.name)
def test_a_commented_file_is_the_scenario_that_it_was_made_from(entry: catalog.Entry, every_key: bool) -> None:
    text = commented(tomllib.loads(entry.text), every_key=every_key, schema=True)
    assert text.startswith(f"#:schema ./{SCHEMA_NAME}\n")
    assert config.parse(text, source="made", name=entry.name) == catalog.find(entry.name)
    if every_key:
        missing = [key for of in TABLES.values() for key in of.keys if f"{key.name} = " not in text]
        assert missing == []


def test_options_of_foreign_parts_stand_in_a_commented_file_as_tables_within_their_table() -> None:
    options = {"p": 0.6, "a key": {"deep": [1, {"x": "y"}]}}
    tree = {"routing": {"options": options}, "applications": [{"use": "a:B", "options": options}, {"use": "c"}]}
    read = tomllib.loads(commented(tree))
    assert (read["routing"], read["applications"]) == (tree["routing"], tree["applications"])


def test_every_default_in_a_commented_file_is_taken_when_it_is_uncommented() -> None:
    lines = commented({}).splitlines()
    unset = "(unset)"
    text = "\n".join(
        line.removeprefix("# ")
        for line in lines[: next(at for at, line in enumerate(lines) if line.startswith("# [["))]
        if line.startswith("[") or (unset not in line and _is_toml(line))
    )
    assert config.parse(text, source="made", name="unnamed") == config.parse("", source="none", name="unnamed")


def _is_toml(line: str) -> bool:
    name, equals, value = line.removeprefix("# ").partition(" = ")
    try:
        return bool(equals) and " " not in name and tomllib.loads(f"v = {value}") is not None
    except tomllib.TOMLDecodeError:
        return False


def test_the_schema_describes_every_key_and_refuses_what_is_unknown() -> None:
    schema = json_schema()
    assert json.loads(json.dumps(schema)) == schema
    assert schema["additionalProperties"] is False
    radio = schema["$defs"]["Radio"]
    assert radio["additionalProperties"] is False
    assert "announces a transmission" in radio["properties"]["lead_ms"]["description"]
    assert "\n" not in radio["properties"]["lead_ms"]["description"]


def test_the_pages_are_checked_against_the_models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = runpy.run_path(str(ROOT / "scripts" / "generate_scenario_reference.py"))
    main, folder = script["main"], tmp_path / "scenario"
    monkeypatch.setitem(main.__globals__, "FOLDER", folder)

    assert main([]) == 0
    assert main(["--check"]) == 0
    (folder / "radio.md").write_text("edited by hand")
    assert main(["--check"]) == 1
    assert main([]) == 0
    (folder / "of_no_table.md").write_text("left over")
    assert main(["--check"]) == 1
