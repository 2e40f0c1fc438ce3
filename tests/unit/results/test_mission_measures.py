"""What is measured of a mission, on traces of a few lines."""

import math
from collections.abc import Sequence
from typing import Any

import pytest

from fanet_mw.scenario import Scenario
from fanet_mw.trace import (
    Confirmed,
    Detected,
    FlightModeChanged,
    KnownOnGround,
    Located,
    MissionModeChanged,
    Posed,
    ProcessEnded,
    ProcessStarted,
    Record,
    Refuted,
)
from fanet_mw.units import S
from fanet_mw.wire.survivors import person_id
from sim.results.mission import CoveredCells, PhotographedCells, mission
from sim.scenarios import catalog

KEYS: dict[str, Any] = {
    "nodes": {"count": 3}, "clusters": {"count": 1}, "world": {"area_m": 500.0}, "radio": {"range_m": 250.0},
    "mission": {"survivors": 2, "survivor_positions_m": ((100.0, 0.0), (-100.0, 0.0))},
}  # fmt: skip


def measured(records: Sequence[Record], ground: dict[str, Any] | None = None, **mission_keys: float) -> dict[str, Any]:
    keys = {**KEYS, "mission": {**KEYS["mission"], **mission_keys}, "ground": ground or {}}
    return mission(Scenario(**keys), records)


def test_the_cells_of_the_largest_area_fit_into_memory_and_are_counted() -> None:
    """Metres in place of kilometres took gigabytes and minutes after the run, for figures of which nobody had asked."""
    largest = Scenario(**{**KEYS, "world": {"area_m": 1e6}})
    for cells in (CoveredCells(largest), PhotographedCells(largest)):
        assert cells.seen.size == 2_000**2
        cells.add([(250.0, 250.0, 10_000.0)])
    assert CoveredCells(Scenario(**KEYS)).seen.size == 20**2


def at(t_s: int, *easts: float) -> list[Record]:
    return [Posed(t_s * S, node, east, 0.0, 50.0) for node, east in enumerate(easts, start=1)]


def test_a_swarm_is_connected_while_everyone_reaches_everyone_over_hops() -> None:
    found = measured([*at(1, 0, 240, 480), *at(2, 0, 240, 491), *at(3, 0, 240, 489), *at(4, 0, 251, 502)])
    assert found["connected"] == 0.5


def test_the_dead_need_no_connection() -> None:
    found = measured([ProcessEnded(S, 3, "agent-3", 1), *at(2, 0, 240, 900)])
    assert found["connected"] == 1.0


def test_who_was_started_again_is_none_of_the_dead() -> None:
    """Under --respawn a UAV counted as dead to the end, though it flew on."""
    again = [ProcessEnded(S, 3, "agent-3", 1), ProcessStarted(S, 3, "agent-3")]
    assert measured([*again, *at(2, 0, 240, 900)])["connected"] == 0.0


@pytest.mark.parametrize("back", ["goto", "return"])
def test_who_is_brought_home_by_its_flight_controller_need_not_be_in_reach(back: str) -> None:
    away = [*at(1, 0, 100, 900), *at(2, 0, 100, 900)]
    modes = [FlightModeChanged(S, 3, "return"), FlightModeChanged(S, 3, back)]
    assert measured([*modes, *away])["connected"] == (1.0 if back == "return" else 0.0)


@pytest.mark.parametrize("gone", [MissionModeChanged(S, 3, "return", 0), FlightModeChanged(S, 3, "fallen")])
def test_who_has_left_the_search_or_has_fallen_need_not_be_in_reach(
    gone: MissionModeChanged | FlightModeChanged,
) -> None:
    away = at(2, 0, 240, 900)
    assert measured(away)["connected"] == 0.0
    assert measured([gone, *away])["connected"] == 1.0
    assert measured([gone, *away])["nearest_m"]["least"] == 240.0, "it is in the way of others all the same"
    assert measured([gone, *at(2, 0, 900, 910)])["connected"] == 0.0
    back = MissionModeChanged(2 * S, 3, "search", 0)
    assert measured([gone, back, *away])["connected"] == (1.0 if gone.mode == "fallen" else 0.0), "a wreck stays one"


def test_what_cameras_have_shown_is_a_share_of_its_own() -> None:
    assert measured(at(1, 0, 0, 0))["photographed"] is None
    seen = {"sensors": {"camera_hz": 2.0, "camera_fov_deg": 90.0, "camera_pixels": (400, 200)}}
    found = mission(Scenario(**KEYS, **seen), [*at(1, -200, 0, 200), *at(2, -150, 50, 1000)])
    assert found["photographed"] == pytest.approx((3 * 100 + 2 * 50) * 50 / 500**2)


def test_coverage_is_the_share_of_the_area_within_range_of_a_receiver() -> None:
    circle = math.pi * 137**2 / 500**2
    assert abs(measured(at(1, 0, 0, 0))["coverage"] - circle) < 0.02, "cells of 25 m"
    assert measured(at(1, 0, 0, 0), rubble_db=20)["coverage"] == 0.0, "a phone under rubble is not received from 50 m"
    everywhere = [Posed(S * k, 1, -250 + 100 * (k % 6), -250 + 100 * (k // 6), 50.0) for k in range(36)]
    found = measured(everywhere)
    assert found["coverage"] == 1.0
    assert found["covered_95_s"] < 36


def test_a_survivor_is_confirmed_once_and_its_error_is_that_of_the_place_that_was_told_first() -> None:
    found = measured([Confirmed(7 * S, 1, 1, 103.0, 4.0), Confirmed(9 * S, 2, 1, 100.0, 0.0)])
    assert (found["confirmed"], found["time_to_confirm_s"], found["confirmed_error_m"]) == (1, [7.0], 5.0)


def test_a_survivor_waits_from_the_first_reception_to_the_right_confirmation() -> None:
    heard = [Detected(2 * S, 1, 1, -80.0), Detected(3 * S, 2, 1, -70.0), Detected(5 * S, 2, 2, -70.0)]
    found = [Confirmed(7 * S, 1, 1, 103.0, 4.0), Confirmed(15 * S, 1, 2, -100.0, 0.0)]
    assert measured([*heard, *found])["wait_s"] == {"p50": 7.5, "max": 10.0}
    assert measured(heard)["wait_s"] == {"p50": None, "max": None}
    away = Confirmed(4 * S, 1, 1, -100.0, 0.0)
    assert measured([*heard, away, Refuted(6 * S, 1, 1, -100.0, 0.0), found[0]])["wait_s"]["max"] == 5.0


def test_who_was_told_by_another_phone_at_that_place_does_not_wait_until_that_is_noticed() -> None:
    heard, somebody = Detected(2 * S, 1, 1, -80.0), person_id(3, 0)
    named = [Confirmed(5 * S, 1, 2, 100.0, 1.0)]
    renamed = [Confirmed(50 * S, 3, somebody, 100.0, 1.0), Refuted(50 * S, 3, 2, 100.0, 1.0)]
    assert measured([heard, *named, *renamed])["wait_s"] == {"p50": 3.0, "max": 3.0}
    later = renamed[0]._replace(t_ns=60 * S)
    assert measured([heard, *named, renamed[1], later])["wait_s"]["max"] == 58.0, "in between nobody was told there"
    elsewhere = renamed[0]._replace(north_m=-15.0)
    assert measured([heard, *named, elsewhere, renamed[1]])["wait_s"]["max"] == 48.0, "that was somebody else"


def test_the_wait_since_a_survivor_was_located_is_told_beside_that_since_the_first_reception() -> None:
    heard = [Detected(2 * S, 1, survivor, -80.0) for survivor in (1, 2)]
    located = [Located(5 * S, 1, 1, 140.0, 0.0), Located(6 * S, 2, 1, 110.0, 0.0)]
    found = [Confirmed(7 * S, 1, 1, 103.0, 4.0), Confirmed(15 * S, 1, 2, -100.0, 0.0)]
    assert measured([*heard, *located, *found])["located_wait_s"] == {"p50": 1.0, "max": 2.0}, "2 is seen at once"
    assert measured(heard)["located_wait_s"] == {"p50": None, "max": None}


def test_the_post_knows_of_a_survivor_once_it_has_learned_of_the_right_confirmation() -> None:
    found = [Confirmed(7 * S, 1, 1, 103.0, 4.0), Confirmed(15 * S, 1, 2, -100.0, 0.0)]
    learned = [KnownOnGround(9 * S, 4, 1, 103.0, 4.0), KnownOnGround(30 * S, 4, 1, 103.0, 4.0)]
    assert measured([*found, *learned])["post_knows_s"] == {"count": 1, "p50": 2.0, "p95": 2.0, "max": 2.0}
    assert measured(found)["post_knows_s"] == {"count": 0, "p50": None, "p95": None, "max": None}
    early = KnownOnGround(5 * S, 4, 1, -100.0, 0.0)
    assert measured([*found, early])["post_knows_s"]["count"] == 0, "it believed somebody else to be there"


def test_the_post_is_connected_while_all_searching_uavs_reach_it_over_hops() -> None:
    poses = [*at(1, 0, 240, 480), *at(2, 0, 240, 900), *at(3, 400, 600, 800)]
    assert measured(poses)["post_connected"] is None
    near = measured(poses, ground={"at_m": (-100.0, 0.0)})
    assert near["post_connected"] == pytest.approx(1 / 3, abs=1e-4)
    far = measured(poses, ground={"at_m": (-100.0, 0.0), "gain_dbi": 12.0})
    assert far["post_connected"] == pytest.approx(2 / 3, abs=1e-4), "995 m: the one at 1,000 m is too far"


def test_a_person_without_a_phone_is_a_survivor_once_and_otherwise_false() -> None:
    def person(node: int, east_m: float) -> Confirmed:
        return Confirmed(9 * S, node, person_id(node, 0), east_m, 0.0)

    named = Confirmed(7 * S, 1, 1, 103.0, 4.0)
    assert figures([person(1, -98.0)]) == (0, 1, 0)
    assert figures([named, person(1, -98.0)]) == (1, 2, 0)
    assert figures([named, person(1, 99.0)]) == (1, 1, 0), "the same one, with and without a name"
    assert figures([person(1, -98.0), person(2, -103.0)]) == (0, 1, 1), "told twice"
    assert figures([person(1, 0.0)]) == (0, 0, 1), "nobody there"
    assert figures([person(1, 0.0), Refuted(9 * S, 1, person_id(1, 0), 0.0, 0.0)]) == (0, 0, 0)


def figures(records: Sequence[Record]) -> tuple[int, int, int]:
    found = measured(records)
    return found["confirmed"], found["persons"], found["persons_false"]


def test_without_positions_nothing_is_claimed_of_the_flight() -> None:
    found = measured([])
    assert (found["coverage"], found["covered_95_s"], found["connected"]) == (None, None, None)


def test_a_survivor_announced_where_somebody_else_is_does_not_count() -> None:
    found = measured([Confirmed(7 * S, 1, 1, -100.0, 0.0), Confirmed(9 * S, 2, 1, 100.0, 0.0)])
    assert (found["confirmed"], found["mistaken"], found["time_to_confirm_s"]) == (0, 1, [])


def test_a_confirmation_that_was_taken_back_counts_for_nothing() -> None:
    wrong, again = Confirmed(7 * S, 1, 1, -100.0, 0.0), Confirmed(30 * S, 2, 1, 100.0, 0.0)
    back = Refuted(20 * S, 3, 1, -99.0, 4.0)
    found = measured([wrong, back, again])
    assert (found["confirmed"], found["mistaken"], found["reopened"]) == (1, 0, 1)
    assert found["time_to_confirm_s"] == [30.0]
    assert measured([wrong, back])["confirmed"] == 0
    elsewhere = measured([wrong, back._replace(east_m=100.0), again])
    assert (elsewhere["mistaken"], elsewhere["reopened"]) == (1, 0)


def test_the_nearest_other_uav_is_looked_for_once_a_second_among_the_living() -> None:
    records = [record for t_s in range(1, 100) for record in at(t_s, 0, 60, 160)]
    found = measured([*records, *at(100, 0, 6, 160), ProcessEnded(100 * S, 2, "agent-2", 1), *at(101, 0, 1, 160)])
    assert found["nearest_m"] == {"least": 6.0, "p1": 60.0, "p50": 60.0}
    assert measured(at(1, 0))["nearest_m"] is None


def test_a_phone_that_is_received_everywhere_covers_everything() -> None:
    found = measured(at(1, 0, 100, 200), phone_power_dbm=300.0, detection_dbm=-300.0, phone_exponent=0.1)
    assert found["coverage"] == 1.0


def test_a_search_for_phones_that_are_received_everywhere_can_be_planned() -> None:
    loud = ("mission.phone_power_dbm=300", "mission.detection_dbm=-300", "mission.phone_exponent=0.1")
    assert catalog.find("rescue", loud).mission.phone_exponent == 0.1
