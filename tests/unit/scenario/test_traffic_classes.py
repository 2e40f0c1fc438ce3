"""`[[traffic]]`: what a file may say, and what a run says of each class."""

from pathlib import Path
from typing import Any

import pytest
import tomli_w

import fanet_mw
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario, config
from fanet_mw.scenario.commented import commented
from fanet_mw.scenario.reference import json_schema
from sim.planner.variant import vary

TWO = """
duration_s = 20
warmup_s = 8
drain_s = 4
[nodes]
count = 5
spacing_m = 100
[routing]
protocol = "flooding"
[[traffic]]
name = "app_1"
interval_s = 1.0
[[traffic]]
name = "app_2"
payload_bytes = 512
interval_s = 0.5
sources = [2]
destination = 4
priority = "report"
"""


def read(tmp_path: Path, text: str, *overrides: str) -> Scenario:
    path = tmp_path / "s.toml"
    path.write_text(text, encoding="utf-8")
    return config.load(path, overrides)


def test_results_have_figures_for_each_class(tmp_path: Path) -> None:
    summary: Any = fanet_mw.simulate(read(tmp_path, TWO)).summary
    assert [*summary["classes"]] == ["app_1", "app_2"]
    assert [part["generated"] for part in summary["classes"].values()] == [40, 16]
    assert summary["generated"] == 40, "above stands the first class"
    assert summary["classes"]["app_2"]["delivered"] == 16
    assert summary["classes"]["app_1"]["pdr"] > 0.9
    assert summary["unknown"] == 0


def test_overrides_name_a_class_by_its_number_and_a_resolved_scenario_is_the_same(tmp_path: Path) -> None:
    found = read(tmp_path, TWO, "traffic.1.interval_s=2")
    assert found.further_traffic[0].interval_s == 2
    assert config.build(found.model_dump(mode="json", exclude_none=True)) == found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TWO.replace("app_2", "app_1"), "must be different"),
        (TWO.replace("app_2", "report"), "none of"),
        (TWO.replace("destination = 4", "destination = 9"), "traffic.1.destination = 9"),
        (TWO.replace("sources = [2]", "sources = [12]"), r"traffic.1.sources = \[12\]"),
        (TWO + "[radio]\nmax_frame_bytes = 600\n", "traffic.0.payload_bytes = 1024"),
        (TWO.replace("sources = [2]", "sources = 5"), "traffic.1.sources = 5 must be <= 4, the nodes that are not t"),
        (TWO + 'arrivals = "trace"\n', "traffic.packets: 0"),
        (TWO.replace("sources = [2]", "on_s = -1"), "traffic.1.on_s = -1: "),
        (TWO.replace("sources = [2]", "source = [2]"), r"traffic.1.source: unknown key; did you mean sources\?"),
    ],
)
def test_what_is_wrong_with_a_class_is_said(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        read(tmp_path, text)


def test_a_timetable_has_room_for_the_first_class_only(tmp_path: Path) -> None:
    text = TWO.replace('protocol = "flooding"', 'protocol = "clustered"\n[clusters]\ncount = 1\nrelay = "scheduled"')
    with pytest.raises(ConfigError, match="has room for bulk of the first class, 1024 bytes"):
        read(tmp_path, text)
    assert read(tmp_path, text.replace('priority = "report"', "")).further_traffic


def test_a_trace_is_read_from_a_file_beside_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "load.csv").write_text("seconds,bytes\n0.5, 100\n\n1.25,200\n", encoding="utf-8")
    text = TWO + 'arrivals = "trace"\npackets_csv = "load.csv"\n'
    assert read(tmp_path, text).further_traffic[0].packets == ((0.5, 100), (1.25, 200))
    (tmp_path / "load.csv").write_text("0.5,100\nsoon,200\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="line 2: 'soon,200' must be seconds,bytes"):
        read(tmp_path, text)


def test_several_classes_are_written_as_they_are_read_and_the_schema_knows_both_forms(tmp_path: Path) -> None:
    found = read(tmp_path, TWO)
    for tree in (
        found.model_dump(mode="json", exclude_none=True),
        found.model_dump(mode="json", exclude_none=True, exclude_defaults=True),
    ):
        assert [entry["name"] for entry in tree["traffic"]] == ["app_1", "app_2"]
        assert "further_traffic" not in tree
        assert read(tmp_path, tomli_w.dumps(tree)) == found
    assert read(tmp_path, commented(tree)) == found
    one = read(tmp_path, TWO.partition("[[traffic]]")[0])
    assert one.model_dump()["traffic"]["payload_bytes"] == 1024
    keys = json_schema()["properties"]
    assert "further_traffic" not in keys
    one_table, several = keys["traffic"]["anyOf"]
    assert several == {"type": "array", "items": one_table} == {"type": "array", "items": {"$ref": "#/$defs/Traffic"}}


def test_a_change_of_the_traffic_is_one_of_its_first_class(tmp_path: Path) -> None:
    found = vary(read(tmp_path, TWO), {"traffic.interval_s": 4.0})
    assert found is not None
    assert [traffic.interval_s for traffic in found.scenario.traffic_classes.values()] == [4.0, 0.5]
