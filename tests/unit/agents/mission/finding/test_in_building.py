"""A phone that is heard from all sides of a building, around which nobody lies, is inside."""

import math

from seeing_uav import UP_M, Uav, mean_dbm

from agents.mission.finding.in_building import place_in_building
from agents.mission.finding.known_survivors import KnownSurvivor
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
    known, small = heard_around(Enu(6, 6, 0)), OnboardMap((Building(5, 5, 16, 16, 12.0),))
    assert place_in_building(known, small, lambda *_: 1) is None
    twice = place_in_building(known, small, lambda *_: 2)
    assert twice is not None
    assert place_in_building(known, small, lambda *_: 4) == twice


def test_a_phone_beside_a_building_or_heard_too_little_is_in_none() -> None:
    assert place_in_building(heard_around(Enu(48, -40, 0)), MAP, lambda *_: 1) is None
    assert place_in_building(heard_around(Enu(8, 6, 0), angles=range(0, 80, 40)), MAP, lambda *_: 2) is None
    assert place_in_building(heard_around(Enu(8, 6, 0)), NO_MAP, lambda *_: 2) is None


def test_where_nobody_was_seen_from_two_sides_is_a_building_that_the_map_lacks() -> None:
    place = place_in_building(heard_around(Enu(48, -40, 0)), MAP, lambda *_: 2)
    assert place is not None
    assert place.distance_m(Enu(48, -40, 0)) < 15
    assert place_in_building(heard_around(Enu(48, -40, 0)), MAP, lambda east, _: 2 * (east < 60)) is None


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
