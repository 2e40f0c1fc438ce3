"""Where a phone is, by received powers and by silence; and where a camera looks."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from agents.mission.finding.phone_localization import CELL_M, REFERENCE_LOSS_DB, Estimate, PhoneFilter, PhoneModel
from agents.mission.finding.sightings import ground_place
from fanet_mw.units import Enu

MODEL = PhoneModel(power_dbm=15, exponent=3, shadowing_db=4, offset_db=1, threshold_dbm=-90)


def rssi_dbm(place: Enu, at: Enu) -> float:
    return MODEL.power_dbm - REFERENCE_LOSS_DB - 30 * math.log10(at.minus(place).norm())


def test_an_estimate_lies_on_the_ground_and_errs_most_along_its_longer_axis() -> None:
    place = Estimate(30.0, -40.0, 25.0, 12.0, 25.0)
    assert place.at == Enu(30.0, -40.0, 0.0)
    assert place.sigma_m == pytest.approx(math.sqrt(25.0 + 12.0))
    assert Estimate(0.0, 0.0, 9.0, 0.0, 16.0).sigma_m == pytest.approx(4.0)


def test_two_that_pass_on_either_side_find_the_phone_and_know_how_well() -> None:
    truth, phone = Enu(60, 10, 0), PhoneFilter(MODEL)
    for north in range(-120, 121, 30):
        for node, east in ((1, 0), (2, 180)):
            phone.on_rssi(node, Enu(east, north, 50), rssi_dbm(truth, Enu(east, north, 50)))
    place = phone.estimate()
    assert place is not None
    assert place.distance_m(truth) < 12
    assert 5 < place.sigma_m < 40


def test_one_that_passes_straight_leaves_the_side_open_and_silence_elsewhere_settles_it() -> None:
    truth, phone = Enu(80, 0, 0), PhoneFilter(MODEL)
    for north in range(-90, 91, 30):
        phone.on_rssi(1, Enu(0, north, 50), rssi_dbm(truth, Enu(0, north, 50)))
    open_sides = phone.estimate()
    assert open_sides is not None
    assert abs(open_sides.east_m) < 25
    assert open_sides.east_variance_m2 > 50**2
    for north in range(-90, 91, 30):
        phone.on_silence(Enu(-120, north, 50))
    settled = phone.estimate()
    assert settled is not None
    assert settled.east_m > 40


def test_many_places_without_reception_in_one_shadow_do_not_drive_the_phone_away() -> None:
    truth, phone = Enu(0, 0, 0), PhoneFilter(MODEL)
    for node, angle in enumerate(range(-120, 121, 40)):
        at = Enu(100 * math.cos(math.radians(angle)), 100 * math.sin(math.radians(angle)), 50)
        phone.on_rssi(node, at, rssi_dbm(truth, at))
    for west in range(110, 200, 26):
        for north in range(-52, 53, 26):
            phone.on_silence(Enu(-west, north, 50))
    phone.estimate()
    assert phone.deficit(truth.east, truth.north) < 6.0, "19 of 20 are that near: chi-square, 2 degrees of freedom"


@pytest.mark.parametrize(("far_m", "counts"), [(449, True), (450, True), (451, False)])
def test_that_a_phone_is_not_received_counts_up_to_450_m_from_where_it_was(far_m: float, *, counts: bool) -> None:
    loud = PhoneModel(power_dbm=40, exponent=3, shadowing_db=4, offset_db=1, threshold_dbm=-90)
    phone = PhoneFilter(loud)
    phone.on_rssi(1, Enu(0, 0, 50), -60)
    before = phone.estimate()
    phone.on_silence(Enu(far_m, 0, 50))
    assert (phone.estimate() != before) == counts


def test_no_place_is_known_better_than_within_a_cell() -> None:
    truth, phone = Enu(60, 0, 0), PhoneFilter(MODEL)
    for node in range(1, 226):
        at = Enu(60 + CELL_M * (node % 15 - 7), CELL_M * (node // 15 - 7), 10)
        phone.on_rssi(node, at, rssi_dbm(truth, at))
    place = phone.estimate()
    assert place is not None
    assert (place.east_m, place.north_m) == pytest.approx((60, 0), abs=0.1)
    assert (place.east_variance_m2, place.north_variance_m2) == pytest.approx((CELL_M**2 / 12,) * 2, rel=0.01)


def test_the_same_place_counts_once_for_a_node() -> None:
    phone = PhoneFilter(MODEL)
    assert phone.on_rssi(1, Enu(0, 0, 50), -70)
    assert not phone.on_rssi(1, Enu(5, 5, 50), -60)
    assert phone.on_rssi(2, Enu(5, 5, 50), -60)


def test_many_powers_that_share_one_shadow_do_not_rule_the_true_place_out() -> None:
    """A hill weakens the phone by 5 dB to the west: 15 powers received there tell less than 15."""
    truth, phone = Enu(120, 0, 0), PhoneFilter(MODEL)
    for north in range(-60, 61, 30):
        for east in (-30, 0, 30):
            at = Enu(east, north, 50)
            phone.on_rssi(1 + (east + 30) // 30, at, rssi_dbm(truth, at) - 5)
    assert phone.received_powers == 15
    assert phone.estimate() is not None
    assert phone.deficit(truth.east, truth.north) < 6, "if each counted for itself it would be 9.6"
    assert phone.deficit(0, 0) > 15, "it is not among them"


def test_powers_received_far_from_each_other_count_for_themselves() -> None:
    truth = Enu(0, 0, 0)
    places = [Enu(100 * math.cos(angle), 100 * math.sin(angle), 50) for angle in (0, 1.57, 3.14, 4.71)]
    few, many = PhoneFilter(MODEL), PhoneFilter(MODEL)
    for node, at in enumerate(places, start=1):
        many.on_rssi(node, at, rssi_dbm(truth, at))
        few.on_rssi(node, places[0]._replace(north=6.0 * node), rssi_dbm(truth, places[0]))
    near, vague = many.estimate(), few.estimate()
    assert near is not None
    assert vague is not None
    assert near.sigma_m < 55 < 90 < vague.sigma_m


@given(st.floats(-1000, 1000), st.floats(-1000, 1000), st.floats(20, 100), st.floats(-80, 80), st.floats(-80, 80))
def test_a_camera_looks_at_the_ground_where_its_angles_lead(
    east: float, north: float, up: float, along: float, across: float
) -> None:
    bearing, elevation = math.atan2(along, across), -math.atan2(up, math.hypot(along, across))
    looked = ground_place(Enu(east, north, up), bearing_rad=bearing, elevation_rad=elevation)
    assert looked is not None
    assert math.hypot(looked[0] - east - along, looked[1] - north - across) < 1e-6 * (1 + abs(east) + abs(north))


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(20, 100), st.floats(-60, 60), st.floats(-60, 60))
def test_on_a_slope_a_camera_looks_at_the_slope(
    eastward: float, northward: float, up: float, along: float, across: float
) -> None:
    def rise_m(east_m: float, north_m: float) -> float:
        return eastward * east_m + northward * north_m

    down = up - rise_m(along, across)
    assume(down > 0.2 * math.hypot(along, across))
    bearing, elevation = math.atan2(along, across), -math.atan2(down, math.hypot(along, across))
    looked = ground_place(Enu(0, 0, up), bearing_rad=bearing, elevation_rad=elevation, rise_m=rise_m)
    assert looked is not None
    assert math.hypot(looked[0] - along, looked[1] - across) < 0.1
    assert looked[2] == pytest.approx(math.hypot(along, across, down), abs=0.1)


def test_a_direction_that_meets_no_ground_shows_nobody() -> None:
    def falls_m(east_m: float, north_m: float) -> float:
        return -2.0 * abs(east_m)

    assert ground_place(Enu(0, 0, 65), bearing_rad=math.pi / 2, elevation_rad=-0.8, rise_m=falls_m) is None
