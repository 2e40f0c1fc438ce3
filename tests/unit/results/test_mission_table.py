"""The table `mission`, figure by figure: counts, times and errors off the axes, and cells against their definition."""

import math
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit import examples

from fanet_mw.bus.radio_control import Jam, Partition, extent_of
from fanet_mw.scenario import Scenario
from fanet_mw.trace import (
    Approaching,
    Collided,
    Confirmed,
    Detected,
    KnownOnGround,
    Located,
    PlacedAmong,
    PlacedInside,
    Posed,
    RadioFault,
    Record,
    Refuted,
)
from fanet_mw.units import Enu, NodeId, S
from fanet_mw.wire.survivors import person_id
from sim.results.mission import Confirmations, CoveredCells, PhotographedCells, mission
from sim.world.sensors.phone import REFERENCE_LOSS_DB

TRUTH = (Enu(100, 60, 0), Enu(-100, -20, 0), Enu(30, -150, 0))
KEYS: dict[str, Any] = {
    "nodes": {"count": 3}, "clusters": {"count": 1}, "world": {"area_m": 500.0}, "radio": {"range_m": 250.0},
    "mission": {"survivors": 3, "survivor_positions_m": tuple((at.east, at.north) for at in TRUTH)},
}  # fmt: skip
MS = S // 1000
FORGED = 4
"""The number of a survivor who does not exist."""


def measured(records: Sequence[Record], **tables: dict[str, Any]) -> dict[str, Any]:
    return mission(Scenario(**{**KEYS, **tables}), records)


def poses(t_s: float, *places: tuple[float, float]) -> list[Record]:
    return [Posed(round(t_s * S), node, *at, 50.0) for node, at in enumerate(places, start=1)]


def confirmed(t_ns: int, survivor: int, *, off_m: tuple[float, float] = (0.0, 0.0)) -> Confirmed:
    at = TRUTH[survivor - 1]
    return Confirmed(t_ns, 1, survivor, at.east + off_m[0], at.north + off_m[1])


def person(node: int, east_m: float, north_m: float) -> Confirmed:
    return Confirmed(9 * S, node, person_id(node, 0), east_m, north_m)


def test_each_uav_approaches_once_and_each_estimate_has_its_error() -> None:
    found = measured([
        Approaching(2500 * MS, 3, 1, 2, 103.0, 64.0), Approaching(1234 * MS + 400_000, 1, 2, 2, -100.0, -10.0),
        Approaching(9 * S, 3, 3, 2, 30.0, -135.0), Approaching(9 * S, 2, FORGED, 2, 0.0, 0.0),
    ])  # fmt: skip
    assert (found["approached"], found["uavs_approaching"]) == (4, 3)
    assert found["time_to_approach_s"] == [1.234, 2.5, 9.0]
    assert found["localization_error_m"] == 10.0


def test_who_is_placed_inside_is_counted_and_has_an_error_unless_nobody_has_that_number() -> None:
    found = measured(
        [PlacedInside(S, 1, 1, 106.0, 68.0), PlacedInside(S, 1, 3, 30.0, -162.25), PlacedInside(S, 1, FORGED, 0, 0)]
    )
    assert (found["inside"], found["inside_error_m"]) == (3, 11.1)


def test_who_is_said_to_be_among_people_is_counted_and_has_an_error() -> None:
    found = measured([PlacedAmong(S, 1, 1, 106.0, 68.0), PlacedAmong(2 * S, 4, 1, 100.0, 62.0)])
    assert (found["among"], found["among_error_m"], found["confirmed"], found["inside"]) == (1, 6.0, 0, 0)


def test_a_survivor_waits_until_found_as_a_person_or_by_phone_whichever_comes_first() -> None:
    heard = [Detected(S, 1, 1, -80.0), Detected(S, 1, 2, -80.0), Detected(S, 1, 3, -80.0)]
    seen = [Confirmed(4 * S, 7, person_id(7, 0), 100.0, 60.0), Confirmed(3 * S, 7, person_id(7, 1), -100.0, -20.0)]
    found = measured([*heard, *seen, confirmed(9 * S, 1), confirmed(2 * S, 2)])
    assert found["wait_s"] == {"p50": 2.0, "max": 3.0}, "who is not found yet has no wait"


def test_every_collision_counts_once() -> None:
    assert measured([Collided(S, 1, 2), Collided(S, 2, 1), Collided(2 * S, 1, 2)])["collisions"] == 3


def test_times_are_told_to_the_millisecond_in_order() -> None:
    third_ns = S // 3
    found = measured([
        Detected(0, 1, 1, -80.0), Detected(0, 1, 2, -80.0), Located(S, 1, 1, 0.0, 0.0), Located(5 * S, 1, 2, 0.0, 0.0),
        confirmed(2 * S + third_ns, 2), confirmed(S + third_ns, 1), confirmed(3 * S, 3),
        KnownOnGround(S + 2 * third_ns, 9, 1, 0, 0), KnownOnGround(3 * S, 9, 3, 0, 0),
    ])  # fmt: skip
    assert found["time_to_confirm_s"] == [1.333, 2.333, 3.0]
    assert found["wait_s"] == {"p50": 1.833, "max": 2.333}
    assert found["located_wait_s"] == {"p50": 0.167, "max": 0.333}, "who was located later was not waited for"
    assert found["post_knows_s"] == {"count": 2, "p50": 0.167, "p95": 0.317, "max": 0.333}, "or learned at once"


def test_a_confirmation_is_right_up_to_25_m_and_mistaken_beyond() -> None:
    assert measured([confirmed(S, 1, off_m=(15, 20))])["confirmed"] == 1
    found = measured([confirmed(S, 1, off_m=(15, 20.1)), confirmed(S, 2, off_m=(3.0, -4.12))])
    assert (found["confirmed"], found["mistaken"], found["confirmed_error_m"]) == (1, 1, 15.1)


def test_confirmations_of_nobody_are_none_and_their_refutations_reopen_nothing() -> None:
    confirmations = Confirmations(TRUTH)
    for number in (0, FORGED, 9):
        confirmations.add(Confirmed(S, 1, number, 0.0, 0.0))
        confirmations.add(Refuted(2 * S, 1, number, 0.0, 0.0))
    confirmations.add(Refuted(2 * S, 1, 1, 100.0, 60.0))
    confirmations.add(Detected(S, 1, 1, -80.0))  # type: ignore[arg-type]
    assert (confirmations.right(), confirmations.mistaken(), confirmations.persons(), confirmations.reopened) == (
        [], [], ({}, 0), 0,
    )  # fmt: skip


def test_a_person_without_a_phone_who_is_given_up_reopens_nothing() -> None:
    confirmations = Confirmations(TRUTH)
    person = person_id(1, 7)
    for record in (Confirmed(S, 1, person, 100.0, 60.0), Refuted(2 * S, 1, person, 100.0, 60.0)):
        confirmations.add(record)
    assert (confirmations.persons(), confirmations.reopened) == (({}, 0), 0)


def test_a_refutation_takes_back_what_was_confirmed_within_12_m() -> None:
    for away_m, right in ((12.0, 0), (12.1, 1)):
        found = measured([confirmed(S, 2), Refuted(2 * S, 2, 2, -100.0, -20.0 + away_m)])
        assert (found["confirmed"], found["reopened"]) == (right, 1 - right)


def test_of_persons_and_survivors_the_nearest_pairs_belong_together() -> None:
    confirmations = Confirmations((Enu(0, 10, 0), Enu(20, 10, 0), Enu(0, 200, 0)))
    for find in (
        person(7, 11.0, 10.0),
        person(2, 22.0, 10.0),
        person(3, 0.0, -15.0),
        person(5, 0.0, 225.1),
        person(4, 0.0, 180.0),
    ):
        confirmations.add(find)
    persons, others = confirmations.persons()
    assert {survivor: find.node for survivor, find in persons.items()} == {1: 7, 2: 2, 3: 4}, "3 comes too late"
    assert others == 2
    backwards = Confirmations((Enu(0, 10, 0), Enu(20, 10, 0)))
    for find in (person(2, 20.0, 10.0), person(7, 0.0, 10.0)):
        backwards.add(find)
    assert {survivor: find.node for survivor, find in backwards.persons()[0].items()} == {1: 7, 2: 2}


@pytest.mark.parametrize("kind", ["cut", "mute", "deaf", "stop", "crash"])
def test_who_is_taken_off_the_air_need_not_be_in_reach_until_the_fault_ends(kind: str) -> None:
    def fault(t_s: int, *, active: bool, label: str = "a", kind: str = kind) -> RadioFault:
        return RadioFault(t_s * S, 3, 0, kind, label, active)

    away = [(0.0, 0.0), (0.0, 240.0), (0.0, 900.0)]
    records = [fault(1, active=True), *poses(2, *away), fault(3, active=False), *poses(4, *away), *poses(5, *away)]
    assert measured(records)["connected"] == 0.333333
    both = [fault(1, active=True), fault(1, active=True, label="b"), fault(1, active=False), *poses(2, *away)]
    assert measured(both)["connected"] == 1.0, "the other one lasts"
    assert measured([fault(1, active=True, kind="jam"), *poses(2, *away)])["connected"] == 0.0, "it is on the air"


def sides(*group: int, line_m: tuple[float, float, float, float] = (0, 0, 0, 0)) -> str:
    return extent_of(Partition("a", tuple(map(NodeId, group)), line_m))


def jammed(radius_m: float, noise_dbm: float) -> str:
    return extent_of(Jam("a", Enu(0.0, 40.0, 0.0), radius_m, noise_dbm))


@pytest.mark.parametrize(
    ("extent", "connected", "post"),
    [
        (sides(2), 0.5, 0.5),
        (sides(4, 1), 0.5, 0.5),
        (sides(4), 1.0, 0.5),
        (sides(1, 2, 3), 1.0, 0.5),
        (sides(line_m=(0, 45, 9, 45)), 0.5, 0.5),
        (sides(line_m=(45, 0, 45, 9)), 1.0, 1.0),
        (jammed(11, -60), 0.5, 0.5),
        (jammed(9, math.inf), 1.0, 1.0),
        ("circle 0.0 40.0 99.0", 1.0, 1.0),
        ("circle 0.0 40.0 nan 0.0", 1.0, 1.0),
        ("nodes two", 1.0, 1.0),
    ],
)
def test_nobody_is_connected_over_a_partition_or_into_a_jammed_area(extent: str, connected: float, post: float) -> None:
    fault = RadioFault(2 * S, 0, 0, "any", "a", active=True, extent=extent)
    places = (0.0, 10.0), (0.0, 50.0), (0.0, 90.0)
    records = [*poses(1, *places), fault, *poses(2, *places), fault._replace(active=False), *poses(3, *places)]
    found = measured([*records, fault, *poses(4, *places)], ground={"at_m": (-5.0, 0.0), "gain_dbi": 0.0})
    assert (found["connected"], found["post_connected"]) == (connected, post)
    assert found.get("connected_by_distance") in {1.0: (None, 1.0), 0.5: (1.0,)}[connected]


@pytest.mark.parametrize(("noise_dbm", "connected"), [(-60.0, 1.0), (math.inf, 0.0)])
def test_a_jammer_is_counted_where_it_leaves_nothing(noise_dbm: float, connected: float) -> None:
    jam = RadioFault(0, 0, 0, "jam", "a", active=True, extent=jammed(11, noise_dbm))
    records = [jam, *poses(1, (0.0, 10.0), (0.0, 50.0), (0.0, 90.0))]
    assert measured(records, radio={"channel": "air_to_air"})["connected"] == connected


def test_shares_have_six_digits_and_links_end_at_the_range() -> None:
    near, far = [(0.0, 0.0), (0.0, 250.0), (0.0, 500.0)], [(0.0, 0.0), (0.0, 251.0), (0.0, 501.0)]
    found = measured(
        [*poses(1, *near), *poses(2, *far), *poses(3, *far)], ground={"at_m": (0.0, -240.0), "gain_dbi": 0.0}
    )
    assert (found["connected"], found["post_connected"], found["biconnected"]) == (0.333333, 0.333333, 0.0)
    close = measured([*poses(1, (0, 0), (0, 9), (9, 9)), *poses(2, *near), *poses(3, *near)])
    assert (close["biconnected"], close["diameter"], close["cut_vertices"]) == (
        0.333333, {"p50": 2, "most": 2}, {"p50": 1, "most": 1},
    )  # fmt: skip


def test_the_nearest_other_is_looked_for_by_each_uav_from_two_on_and_told_to_the_centimetre() -> None:
    found = measured([*poses(1, (0, 0), (0, 10.123), (0, 30.456))])
    assert found["nearest_m"] == {"least": 10.12, "p1": 10.12, "p50": 10.12}
    two = measured([Posed(S, 1, 0, 0, 50), Posed(S, 2, 3.0, 4.0, 62.0)])
    assert two["nearest_m"] == {"least": 13.0, "p1": 13.0, "p50": 13.0}, "in space"
    apart = measured([*poses(1, (0, 0), (0, 1.111), (0, 2.222)), *poses(2, (0, 0), (0, 1000.555), (0, 2001.111))])
    assert apart["nearest_m"] == {"least": 1.11, "p1": 1.11, "p50": 500.83}


def test_since_when_nearly_all_is_covered_is_the_first_instant_of_95_percent() -> None:
    narrow = {"mission": {**KEYS["mission"], "phone_power_dbm": 15.0, "detection_dbm": -80.0}}
    scenario = Scenario(**{**KEYS, **narrow})
    flown = [(x, y) for y in range(-240, 250, 40) for x in range(-240, 250, 40)]
    cells, since_s = CoveredCells(scenario), None
    records: list[Record] = []
    for index, at in enumerate(flown):
        t_s = 1 + index / 7
        cells.add([(*at, 50.0)])
        since_s = t_s if since_s is None and cells.share >= 0.95 else since_s
        records += poses(t_s, at)
    assert since_s is not None
    assert 2 < since_s < 1 + len(flown) / 7 - 1
    assert measured(records, **narrow)["covered_95_s"] == round(since_s, 3)
    assert measured(poses(1, flown[0]), **narrow)["covered_95_s"] is None


places = st.lists(st.tuples(st.floats(-400, 400), st.floats(-400, 400), st.floats(0, 150)), min_size=1, max_size=3)


@given(at=places, area_m=st.sampled_from([20.0, 90.0, 400.0]))
@example(at=[(0.0, 0.0, 900.0), (50.0, 0.0, 50.0)], area_m=400.0)
def test_a_cell_is_flown_over_if_a_phone_in_its_middle_is_received(
    at: list[tuple[float, float, float]], area_m: float
) -> None:
    scenario = Scenario(**{**KEYS, "world": {"area_m": area_m}, "mission": {"survivors": 0}})
    told = scenario.mission
    cells = CoveredCells(scenario)
    cells.add(at)
    expected = []
    for north in middles(area_m):
        for east in middles(area_m):
            slant_m = min(math.dist((east, north, 0.0), place) for place in at)
            dbm = told.phone_power_dbm - told.rubble_db - REFERENCE_LOSS_DB
            expected.append(dbm - 10 * told.phone_exponent * math.log10(max(slant_m, 1e-9)) > told.detection_dbm)
    assert cells.seen.ravel().tolist() == expected
    assert cells.share == pytest.approx(sum(expected) / len(expected))


@given(at=places, area_m=st.sampled_from([20.0, 90.0, 400.0]))
@examples(60)
def test_a_cell_is_photographed_if_its_middle_is_in_an_image(
    at: list[tuple[float, float, float]], area_m: float
) -> None:
    sensors = {"camera_hz": 2.0, "camera_fov_deg": 80.0, "camera_pixels": (400, 300)}
    scenario = Scenario(**{**KEYS, "world": {"area_m": area_m}, "mission": {"survivors": 0}, "sensors": sensors})
    cells = PhotographedCells(scenario)
    cells.add(at)
    tan = math.tan(math.radians(40))
    assert cells.seen.ravel().tolist() == [
        any(
            abs(east - e) <= min(up, scenario.nodes.altitude_m) * tan
            and abs(north - n) <= min(up, scenario.nodes.altitude_m) * tan * 3 / 4
            for e, n, up in at
        )
        for north in middles(area_m)
        for east in middles(area_m)
    ]


def middles(area_m: float) -> list[float]:
    """The middles of cells of 25 m, about, along one side of the area."""
    count = max(1, round(area_m / 25))
    return [(index + 0.5) * area_m / count - area_m / 2 for index in range(count)]
