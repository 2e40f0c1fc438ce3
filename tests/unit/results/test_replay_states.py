"""What a replay says of survivors and clusters, and the page that plays it, on a trace that was written by hand."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.trace import (
    Approaching,
    Arrived,
    Collided,
    Confirmed,
    Detected,
    FlightModeChanged,
    MissionModeChanged,
    PlacedAmong,
    PlacedInside,
    Posed,
    ProcessEnded,
    ProcessStarted,
    Record,
    Refuted,
    RoleChanged,
)
from fanet_mw.units import Enu, S
from sim.report import replay_page
from sim.results.mission import SurvivorStates, mission
from sim.results.replay import Replay
from sim.world.environment.layout import positions

KEYS = {
    "nodes.count": 2, "nodes.altitude_m": 60, "world.area_m": 600, "duration_s": 30, "mission.survivors": 3,
    "mission.survivor_positions_m": [[0, 0], [100, 0], [-100, 0]],
}  # fmt: skip
RECORDS: list[Record] = [
    *(Posed(t * S, node, 10.0 * t, 50.0 * node, 60.0) for t in range(21) for node in (1, 2)),
    RoleChanged(2 * S, 1, "head", 0, 1),
    RoleChanged(3 * S, 2, "member", 0, 1),
    Detected(4 * S, 1, 1, -80.0),
    Approaching(5 * S, 2, 1, 3, 1.0, 1.0),
    MissionModeChanged(5 * S, 2, "respond", 1),
    Detected(6 * S, 2, 1, -70.0),
    Arrived(7 * S, 2, 1),
    Confirmed(8 * S, 2, 1, 3.0, 0.0),
    Approaching(9 * S, 1, 1, 3, 1.0, 1.0),
    Detected(9 * S, 1, 2, -85.0),
    Confirmed(10 * S, 1, 2, 200.0, 0.0),
    Refuted(12 * S, 1, 2, 200.0, 0.0),
    Collided(13 * S, 1, 0),
    FlightModeChanged(13 * S, 1, "fallen"),
    Confirmed(14 * S, 2, 2, 101.0, 0.0),
    ProcessEnded(15 * S, 2, "agent-2", 1),
]


@pytest.fixture
def replay(make_scenario: Callable[..., Scenario]) -> Replay:
    return Replay(make_scenario(**KEYS), RECORDS)


def test_a_survivor_goes_from_not_heard_to_confirmed_and_a_mistake_is_reopened(replay: Replay) -> None:
    states = {survivor: [(s.t_ns // S, s.status, s.node) for s in seen] for survivor, seen in replay.finds.items()}
    assert states == {
        1: [(0, "not heard", 0), (4, "detected", 1), (5, "approached", 2), (7, "reached", 2), (8, "confirmed", 2)],
        2: [(0, "not heard", 0), (9, "detected", 1), (10, "mistaken", 1), (12, "reopened", 1), (14, "confirmed", 2)],
        3: [(0, "not heard", 0)],
    }
    assert [replay.found(t)[2].status for t in (0, 8.99, 9, 11, 13, 14)] == [
        "not heard", "not heard", "detected", "mistaken", "reopened", "confirmed",
    ]  # fmt: skip


def test_a_survivor_said_to_be_in_a_building_or_among_people_is_so_until_confirmed() -> None:
    states = SurvivorStates([Enu(0, 0, 0), Enu(50, 0, 0)])
    said: list[Record] = [
        Detected(S, 1, 1, -80.0), PlacedInside(2 * S, 1, 1, 5.0, 0.0), Arrived(3 * S, 2, 1),
        PlacedAmong(4 * S, 2, 2, 60.0, 0.0), Confirmed(5 * S, 1, 2, 51.0, 0.0),
    ]  # fmt: skip
    changes = [state for record in said if (state := states.take(record)) is not None]
    assert [(survivor, state.status) for survivor, state in changes] == [
        (1, "detected"), (1, "inside"), (2, "among"), (2, "confirmed"),
    ]  # fmt: skip


def test_a_place_is_between_the_records_before_and_after_the_instant(make_scenario: Callable[..., Scenario]) -> None:
    zigzag = [Posed(t * S, node, east, 0.0, 60.0) for t, east in enumerate([0.0, 10.0, 0.0, 30.0]) for node in (1, 2)]
    seen = Replay(make_scenario(**KEYS), zigzag)
    instants = (0.0, 0.5, 1.0, 1.5, 2.5, 3.0, 9.0)
    assert [seen.at(t)[1].position.east for t in instants] == pytest.approx([0, 5, 10, 5, 15, 30, 30])


def test_the_cluster_of_a_uav_is_that_of_the_instant(replay: Replay) -> None:
    assert [(state.role, state.head) for state in replay.at(2.5).values()] == [("head", 1), ("", 0)]
    assert [(state.role, state.head) for state in replay.at(3.0).values()] == [("head", 1), ("member", 1)]


def test_who_was_started_again_has_not_ended(make_scenario: Callable[..., Scenario]) -> None:
    again = [*RECORDS, ProcessStarted(15 * S, 2, "agent-2")]
    ended = [replay_page.content(Replay(make_scenario(**KEYS), records))["ended"] for records in (RECORDS, again)]
    assert ended == [{2: 15.0}, {}]


def test_the_page_has_all_that_is_shown_and_asks_for_nothing(replay: Replay, tmp_path: Path) -> None:
    replay_page.write(replay, tmp_path / "replay.html")
    page = (tmp_path / "replay.html").read_text("utf-8")
    assert not re.search(r"%[A-Z]+%|https?://|\bsrc=|\bhref=|import\s*\(|fetch\(", page), "a page that works offline"
    found = re.search(r'<script type="application/json" id="content">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    content = json.loads(found[1])
    assert content == json.loads(json.dumps(replay_page.content(replay)))
    assert content["at"][4] == [40, 50, 60, 40, 100, 60]
    assert len(content["at"]) == 21
    assert content["survivors"] == [[0, 0], [100, 0], [-100, 0]]
    assert content["finds"][0][-1] == [8, "confirmed", 2]
    assert content["mission"] == {"1": [], "2": [[5, "respond", 1]]}
    assert content["role"]["2"] == [[3, "member", 0, 1]]
    assert content["ended"] == {"2": 15}
    assert [13, 1, "collides with the ground or something solid"] in content["events"]


def test_the_page_and_the_replay_have_the_same_area_covered_at_every_instant(
    make_scenario: Callable[..., Scenario],
) -> None:
    records = [Posed(round(0.37 * step * S), 1, 9.0 * step - 90, 0.0, 60.0) for step in range(20)]
    replay = Replay(make_scenario(**KEYS), records)
    covered = replay_page.content(replay)["covered"]
    shares = [replay.coverage(tenth / 10) for tenth in range(75)]
    assert shares == [
        pytest.approx(sum(0 <= first <= tenth / 10 for first in covered) / len(covered)) for tenth in range(75)
    ]
    assert 0 < shares[0] < shares[30] < shares[-1]
    assert mission(replay.scenario, replay.records)["coverage"] == pytest.approx(shares[-1], abs=1e-6)


def test_a_long_run_is_thinned_and_ends_where_it_ended(replay: Replay, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_page, "_MOST_POINTS", 6)
    content = replay_page.content(replay)
    assert content["step_s"] == 7
    assert [row[0] for row in content["at"]] == [0, 70, 140, 200]


def test_a_description_cannot_end_the_script(make_scenario: Callable[..., Scenario], tmp_path: Path) -> None:
    scenario = make_scenario(**KEYS, description="</script><b>")
    replay_page.write(Replay(scenario, RECORDS), tmp_path / "replay.html")
    assert "</script><b>" not in (tmp_path / "replay.html").read_text("utf-8")


def test_a_trace_without_positions_is_refused(make_scenario: Callable[..., Scenario]) -> None:
    with pytest.raises(ConfigError, match="no positions"):
        replay_page.content(Replay(make_scenario(**KEYS | {"mobility.model": "onboard"}), RECORDS[-3:]))


def test_a_swarm_that_stands_has_no_positions_in_its_trace_and_is_replayed_where_it_began(
    make_scenario: Callable[..., Scenario],
) -> None:
    scenario = make_scenario(**KEYS | {"mobility.model": "static", "duration_s": 30})
    content = replay_page.content(Replay(scenario, RECORDS[-3:]))
    assert content["end_s"] == 30
    assert content["at"][0] == content["at"][-1] == [round(value) for at in positions(scenario) for value in at]


def test_the_post_on_the_ground_is_no_uav_of_a_swarm_that_stands(make_scenario: Callable[..., Scenario]) -> None:
    scenario = make_scenario(**KEYS | {"mobility.model": "static", "ground.at_m": [0, -90]})
    assert Replay(scenario, RECORDS[-3:]).nodes == [*scenario.uav_ids]
