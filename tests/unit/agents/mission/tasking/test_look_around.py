"""A responder that sees nobody at the estimated place looks at the other probable ones."""

import math

from search_board import MODEL, UP_M

from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB, PhoneFilter
from agents.mission.tasking.look_around import LookAround
from fanet_mw.units import Enu, S

LOOK_M = 36.0


def heard_once(truth: Enu, at: Enu) -> PhoneFilter:
    """The filter of a phone of which one power was received."""
    phone = PhoneFilter(MODEL)
    phone.on_rssi(1, at, MODEL.power_dbm - REFERENCE_LOSS_DB - 30 * math.log10(at.minus(truth).norm()))
    return phone


def test_a_uav_that_has_heard_a_phone_once_passes_all_places_where_it_may_be_and_sees_the_person() -> None:
    start, passed = Enu(0, 0, UP_M), 0
    for angle in range(0, 360, 15):
        truth = Enu(80 * math.cos(math.radians(angle)), 80 * math.sin(math.radians(angle)), 0)
        phone, here, look = heard_once(truth, start), start, LookAround(LOOK_M)
        for step in range(600):
            there = look.next_place(1, phone, here, step * S // 10)
            if there is None or here.minus(truth).horizontal() <= LOOK_M:
                break
            way = Enu(there[0] - here.east, there[1] - here.north, 0)
            share = min(1.0, 0.8 / max(1e-9, way.horizontal()))
            here = Enu(here.east + share * way.east, here.north + share * way.north, UP_M)
        passed += here.minus(truth).horizontal() <= LOOK_M
    assert passed >= 20, "within a minute at 8 m/s, without any further power, of 24 places around it"


def test_what_was_looked_at_for_one_survivor_or_in_passing_is_empty_for_another_for_two_minutes() -> None:
    phone, look = heard_once(Enu(0, 0, 0), Enu(0, 0, UP_M)), LookAround(LOOK_M)
    first = look.next_place(1, phone, Enu(300, 0, UP_M), 0)
    assert first is not None
    look.pass_over(Enu(*first, UP_M), S)
    assert look.next_place(2, phone, Enu(300, 0, UP_M), 3 * S) != first
    assert look.next_place(1, phone, Enu(300, 0, UP_M), 122 * S) == first, "whoever walks may be there now"


def test_a_place_is_looked_at_from_as_many_sides_as_it_was_passed_on_and_sides_are_forgotten() -> None:
    look = LookAround(LOOK_M)
    for second, (north_m, sides) in enumerate(((-15, 1), (-12, 1), (15, 2), (18, 2)), 1):
        look.pass_over(Enu(10, north_m, UP_M), second * S)
        assert look.sides_looked_from(0, 0, second * S) == sides, north_m
    assert look.sides_looked_from(0, 0, 124 * S) == look.sides_looked_from(200, 0, 5 * S) == 0
    look.pass_over(Enu(10, -15, UP_M), 200 * S)
    assert look.sides_looked_from(0, 0, 200 * S) == 1


def test_without_a_camera_there_is_nothing_to_look_at() -> None:
    assert LookAround(math.inf).next_place(1, heard_once(Enu(0, 0, 0), Enu(0, 0, UP_M)), Enu(0, 0, UP_M), 0) is None


def test_where_another_uav_has_looked_nobody_looks_again_and_each_takes_the_places_nearer_to_it() -> None:
    phone, here, other = heard_once(Enu(80, 0, 0), Enu(0, 0, UP_M)), Enu(30, 0, UP_M), Enu(-30, 0, UP_M)
    mine, theirs = LookAround(LOOK_M), LookAround(LOOK_M)
    for step in range(12):
        next_mine = mine.next_place(1, phone, here, step * 2 * S, others=[other])
        next_theirs = theirs.next_place(1, phone, other, step * 2 * S, others=[here])
        assert next_mine is not None
        assert next_theirs is not None
        if step < 4:
            assert next_mine[0] > next_theirs[0], "east and west"
        assert not theirs.sides_looked_from(*next_mine, step * 2 * S) or step == 0
        here, other = Enu(*next_mine, UP_M), Enu(*next_theirs, UP_M)
