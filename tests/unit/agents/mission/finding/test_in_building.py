"""A phone that is heard from all sides of a building, around which nobody lies, is inside."""

import math

from seeing_uav import MODEL, UP_M, Uav, mean_dbm

from agents.mission.finding.in_building import place_in_building
from agents.mission.finding.known_survivors import KnownSurvivor
from agents.mission.finding.phone_localization import PhoneFilter
from agents.mission.navigation.onboard_map import NO_MAP, Building, OnboardMap
from fanet_mw.units import Enu
from fanet_mw.wire.survivors import Found, Standing

HOUSE, OTHER = Building(5, 5, 30, 20, 12.0), Building(90, 5, 30, 20, 12.0)
MAP = OnboardMap((OTHER, HOUSE))


def heard_around(truth: Enu, *, angles: range = range(0, 360, 40)) -> KnownSurvivor:
    """A phone that was received on a circle around it."""
    uav = Uav()
    for angle in angles:
        at = Enu(
            truth.east + 60 * math.cos(math.radians(angle)), truth.north + 60 * math.sin(math.radians(angle)), UP_M
        )
        uav.hear(1, 1 + angle // 120, at, mean_dbm(truth, at))
    return uav.survivors.by_id[1]


def test_a_survivor_around_whom_nobody_is_seen_is_in_the_building_that_the_phone_is_in() -> None:
    place = place_in_building(heard_around(Enu(8, 6, 0)), MAP, lambda *_: 2)
    assert place is not None
    assert HOUSE.outside(place.east_m, place.north_m)[0] < 0
    assert place.distance_m(Enu(8, 6, 0)) < 10
    assert place.sigma_m < 15, "in this part of it"


def test_before_it_was_looked_all_around_nobody_says_so() -> None:
    known = heard_around(Enu(8, 6, 0))
    assert place_in_building(known, MAP, lambda *_: 0) is None
    assert place_in_building(known, MAP, lambda east, _: 2 * (east > 5)) is None


def test_who_was_not_seen_from_two_sides_is_more_surely_inside_than_from_one() -> None:
    known = heard_around(Enu(6, 6, 0))
    for side_m, sides in ((16, 3), (20, 2), (24, 1)):
        house = OnboardMap((Building(5, 5, side_m, side_m, 12.0),))
        assert place_in_building(known, house, lambda *_, fewer=sides - 1: fewer) is None
        assert place_in_building(known, house, lambda *_, enough=sides: enough) is not None


def test_who_is_in_one_of_two_houses_is_after_a_while_said_to_be_between_them() -> None:
    known = heard_around(Enu(5, 5, 0))
    houses = OnboardMap((Building(-12, 5, 14, 24, 12.0), Building(22, 5, 14, 24, 12.0)))
    assert place_in_building(known, houses, lambda *_: 3) is None
    place = place_in_building(known, houses, lambda *_: 3, patient=False)
    assert place is not None
    assert place.distance_m(Enu(5, 5, 0)) < 5
    assert 15 < place.sigma_m < 25, "either may be the one"
    assert place_in_building(known, houses, lambda *_: 0, patient=False) is None


def test_outside_of_the_area_nobody_need_have_looked() -> None:
    truth, edge_m = Enu(92, 6, 0), 100.0
    known = KnownSurvivor(PhoneFilter(MODEL._replace(half_m=edge_m)))
    for angle in range(90, 271, 20):
        east, north = 60 * math.cos(math.radians(angle)), 60 * math.sin(math.radians(angle))
        at = Enu(truth.east + east, truth.north + north, UP_M)
        known.filter.on_rssi(angle, at, mean_dbm(truth, at))
    house = OnboardMap((Building(edge_m - 9, 5, 18, 30, 12.0),))
    assert place_in_building(known, house, lambda east, _: 3 * (east < edge_m)) is not None
    assert place_in_building(known, house, lambda east, _: 3 * (east < edge_m - 18)) is None


def test_a_phone_beside_a_building_or_heard_too_little_is_in_none() -> None:
    assert place_in_building(heard_around(Enu(48, -40, 0)), MAP, lambda *_: 1) is None
    assert place_in_building(heard_around(Enu(8, 6, 0), angles=range(0, 80, 40)), MAP, lambda *_: 2) is None
    assert place_in_building(heard_around(Enu(8, 6, 0)), NO_MAP, lambda *_: 2) is None


def test_where_nobody_was_seen_from_three_sides_is_a_building_that_the_map_lacks() -> None:
    far = OnboardMap((OTHER._replace(east_m=300),))
    place = place_in_building(heard_around(Enu(48, -40, 0)), far, lambda *_: 3)
    assert place is not None
    assert place.distance_m(Enu(48, -40, 0)) < 15
    assert place_in_building(heard_around(Enu(48, -40, 0)), far, lambda east, _: 3 * (east < 60)) is None


def test_who_is_inside_a_building_is_sought_no_more_and_is_confirmed_if_seen_after_all() -> None:
    uav = Uav()
    uav.hear(1, 1, Enu(0, 0, UP_M), -70.0)
    inside = Found(5, 1, 8.0, 6.0, 20.0, 0.0, 20.0, 3, Standing.INSIDE)
    assert uav.survivors.sought() == [1]
    assert uav.survivors.on_found(inside, now_ns=0)
    assert not uav.survivors.on_found(inside._replace(east_variance_m2=9.0, north_variance_m2=9.0), now_ns=0)
    assert (uav.survivors.sought(), uav.survivors.unconfirmed()) == ([], [1])
    assert uav.survivors.on_found(inside._replace(standing=Standing.CONFIRMED), now_ns=0)
    assert uav.survivors.unconfirmed() == []
    assert not uav.survivors.on_found(inside, now_ns=0), "a confirmation tells more"
