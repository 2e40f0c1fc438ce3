"""Missions of long tables: what was flown is not flown again, a piece ends in time, and no table gets shorter."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fanet_mw.scenario import Scenario
from sim.sweep.provenance import code
from tests.tables.command import main
from tests.tables.kept import Kept, Missing, OutOfTime, Run, key_of
from tests.tables.markdown import Rows, Tolerance, begin, end, read
from tests.tables.missions import Case, all_flown, flown
from tests.tables.pieces import TABLES as PIECES
from tests.tables.registry import TABLES, Table

MakeScenario = Callable[..., Scenario]


class Flights:
    """Counts the missions that are flown."""

    def __init__(self) -> None:
        self.seeds: list[int] = []

    def __call__(self, scenario: Scenario) -> Run:
        self.seeds.append(scenario.seed)
        return {"confirmed": scenario.seed}


def test_a_mission_is_flown_once_and_its_line_is_read_by_whoever_has_the_file(
    tmp_path: Path, make_scenario: MakeScenario
) -> None:
    path, flights = tmp_path / "data" / "missions.jsonl", Flights()
    kept = Kept(path, flights)
    assert [kept.of(make_scenario(seed=seed))["confirmed"] for seed in (1, 2, 1)] == [1, 2, 1]
    assert flights.seeds == [1, 2]
    reader = Kept(path)
    assert [reader.of(make_scenario(seed=seed))["confirmed"] for seed in (1, 2)] == [1, 2]
    with pytest.raises(Missing, match="seed 3"):
        reader.of(make_scenario(seed=3))


def test_lines_of_two_processes_are_all_kept_in_the_order_of_their_seeds(
    tmp_path: Path, make_scenario: MakeScenario
) -> None:
    path = tmp_path / "missions.jsonl"
    one, other = Kept(path, Flights()), Kept(path, Flights())
    one.of(make_scenario(seed=3), ["nodes.count=3"])
    other.of(make_scenario(seed=2), ["nodes.count=3"])
    one.of(make_scenario(seed=1), ["nodes.count=3"])
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    assert [(line["seed"], line["differences"]) for line in lines] == [(seed, ["nodes.count=3"]) for seed in (1, 2, 3)]
    assert [file.name for file in tmp_path.iterdir()] == ["missions.jsonl"]


def test_a_line_has_six_digits_of_each_figure_and_a_flight_gives_the_same_as_its_line(
    tmp_path: Path, make_scenario: MakeScenario
) -> None:
    found = {"nearest_m": {"least": 1.23456789}, "time_to_confirm_s": [264.12349], "none": None, "count": 1234567}
    kept = Kept(tmp_path / "missions.jsonl", lambda _: found)
    flown = kept.of(make_scenario())
    told = {"nearest_m": {"least": 1.23457}, "time_to_confirm_s": [264.123], "none": None, "count": 1234567}
    assert flown == {**told, "code": code()}
    assert Kept(tmp_path / "missions.jsonl").of(make_scenario()) == flown


@pytest.mark.parametrize("other", [{"seed": 2}, {"mission.search": "spiral"}, {"nodes.count": 10}])
def test_another_seed_or_setting_is_another_mission_and_another_description_is_not(
    make_scenario: MakeScenario, other: dict[str, Any]
) -> None:
    assert key_of(make_scenario(**other)) != key_of(make_scenario())
    assert key_of(make_scenario(description="the same")) == key_of(make_scenario())


def test_a_piece_begins_nothing_that_would_end_after_its_time(tmp_path: Path, make_scenario: MakeScenario) -> None:
    flights = Flights()
    kept = Kept(tmp_path / "missions.jsonl", flights, seconds=-1)
    with pytest.raises(OutOfTime):
        kept.of(make_scenario())
    assert not flights.seeds


def test_a_table_whose_missions_are_not_all_kept_names_them_and_stays_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page, kept = tmp_path / "page.md", Kept(tmp_path / "missions.jsonl", Flights())
    text = f"{begin('small')}\n| case | seeds |\n| --- | --- |\n| one | 20 |\n{end('small')}\n"
    page.write_text(text, encoding="utf-8")
    cases = {"one": Case("quick", (), (1, 2, 3)), "two": Case("quick", ("nodes.count=3",), (1,))}

    def measure() -> Rows:
        there = all_flown(cases, Kept(tmp_path / "missions.jsonl"))
        return [["case", "seeds"], *([name, str(len(flown(case, there)))] for name, case in cases.items())]

    monkeypatch.setitem(TABLES, "small", Table(str(page), measure, Tolerance()))
    cases["one"].flown(kept, 2)
    for flags in ([], ["--check"]):
        assert main([*flags, "small"]) == 1
        assert capsys.readouterr().out.splitlines() == [
            "small: not flown yet: one: seeds [1, 3]", "small: not flown yet: two: seeds [1]"
        ]  # fmt: skip
        assert page.read_text(encoding="utf-8") == text
    for seed in (1, 3):
        cases["one"].flown(kept, seed)
    cases["two"].flown(kept, 1)
    assert main(["small"]) == 0
    assert read(page.read_text(encoding="utf-8"), "small")[1:] == [["one", "3"], ["two", "1"]]


@pytest.mark.parametrize("name", sorted(PIECES.keys() & TABLES.keys()))
def test_a_table_of_missions_that_are_all_kept_says_what_they_came_to(name: str) -> None:
    try:
        rows = TABLES[name].measure()
    except Missing as missing:
        pytest.skip(f"the table stays as it was written, because lines are missing in {len(missing.missions)} cases")
    assert read(TABLES[name].path.read_text(encoding="utf-8"), name) == [list(row) for row in rows]
