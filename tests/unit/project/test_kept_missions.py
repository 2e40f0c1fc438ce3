"""Missions of long tables: what was flown is not flown again, and a piece ends in time."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fanet_mw.scenario import Scenario
from tests.tables.kept import Kept, OutOfTime, Run, key_of

MakeScenario = Callable[..., Scenario]


class Flights:
    """Counts the missions that are flown."""

    def __init__(self) -> None:
        self.seeds: list[int] = []

    def __call__(self, scenario: Scenario) -> Run:
        self.seeds.append(scenario.seed)
        return {"confirmed": scenario.seed}


def test_a_mission_is_flown_once_and_what_was_half_written_is_flown_again(
    tmp_path: Path, make_scenario: MakeScenario
) -> None:
    path, first, second = tmp_path / "runs" / "missions.jsonl", Flights(), Flights()
    kept = Kept(path, first)
    assert [kept.of(make_scenario(seed=seed))["confirmed"] for seed in (1, 2, 1)] == [1, 2, 1]
    assert first.seeds == [1, 2]
    whole = path.read_text(encoding="utf-8")
    path.write_text(whole[:-20], encoding="utf-8")
    again = Kept(path, second)
    assert [again.of(make_scenario(seed=seed))["confirmed"] for seed in (1, 2)] == [1, 2]
    assert second.seeds == [2]
    assert [line["confirmed"] for line in (Kept(path, first).of(make_scenario(seed=seed)) for seed in (1, 2))] == [1, 2]
    assert first.seeds == [1, 2]


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
