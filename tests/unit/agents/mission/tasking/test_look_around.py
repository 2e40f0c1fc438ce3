"""A responder that sees nobody at the estimated place looks at the other probable ones."""

import math

from search_board import MODEL, UP_M

from agents.mission.finding.looked_at import LookedAt
from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB, PhoneFilter
from agents.mission.tasking.look_around import Headway, LookAround
from fanet_mw.units import Enu, S

LOOK_M = 36.0
VIEW_M = (40.0, 40.0)


def heard_once(truth: Enu, at: Enu) -> PhoneFilter:
    """The filter of a phone of which one power was received."""
    phone = PhoneFilter(MODEL)
    phone.on_rssi(1, at, MODEL.power_dbm - REFERENCE_LOSS_DB - 30 * math.log10(at.minus(truth).norm()))
    return phone


def test_a_uav_that_has_heard_a_phone_once_passes_all_places_where_it_may_be_and_sees_the_person() -> None:
    start, passed = Enu(0, 0, UP_M), 0
    for angle in range(0, 360, 15):
        truth = Enu(80 * math.cos(math.radians(angle)), 80 * math.sin(math.radians(angle)), 0)
        looked_at = LookedAt(VIEW_M, height_m=UP_M)
        phone, here, look = heard_once(truth, start), start, LookAround(looked_at)
        for step in range(600):
            if step % 10 == 0:
                looked_at.note(here, step * S // 10)
            there = look.next_place(1, phone, here, step * S // 10)
            if there is None or here.minus(truth).horizontal() <= LOOK_M:
                break
            way = Enu(there[0] - here.east, there[1] - here.north, 0)
            share = min(1.0, 0.8 / max(1e-9, way.horizontal()))
            here = Enu(here.east + share * way.east, here.north + share * way.north, UP_M)
        passed += here.minus(truth).horizontal() <= LOOK_M
    assert passed >= 20, "within a minute at 8 m/s, without any further power, of 24 places around it"


def test_who_turns_to_another_survivor_looks_where_that_one_may_be_and_otherwise_keeps_its_place() -> None:
    look, here, far = LookAround(LookedAt(VIEW_M, height_m=UP_M)), Enu(0, 0, UP_M), Enu(900, 0, UP_M)
    near_one, far_one = heard_once(Enu(80, 0, 0), here), heard_once(Enu(820, 0, 0), far)
    assert look.next_place(1, near_one, here, 0) != look.next_place(2, far_one, here, 0)
    chosen = look.next_place(2, far_one, here, 0)
    assert chosen is not None
    assert math.dist(chosen, (far.east, far.north)) < 300
    assert look.next_place(2, far_one, Enu(chosen[0], chosen[1] + 200, UP_M), S // 2) == chosen


def test_without_a_camera_there_is_nothing_to_look_at() -> None:
    phone = heard_once(Enu(0, 0, 0), Enu(0, 0, UP_M))
    assert LookAround(LookedAt()).next_place(1, phone, Enu(0, 0, UP_M), 0) is None


def test_each_of_two_uavs_takes_the_places_nearer_to_it_where_neither_has_looked() -> None:
    phone, here, other = heard_once(Enu(80, 0, 0), Enu(0, 0, UP_M)), Enu(30, 0, UP_M), Enu(-30, 0, UP_M)
    looked_at = LookedAt(VIEW_M, height_m=UP_M)
    mine, theirs = LookAround(looked_at), LookAround(looked_at)
    for step in range(12):
        next_mine = mine.next_place(1, phone, here, step * 4 * S, others=[other])
        next_theirs = theirs.next_place(1, phone, other, step * 4 * S, others=[here])
        assert next_mine is not None
        assert next_theirs is not None
        if step < 4:
            assert next_mine[0] > next_theirs[0], "east and west"
        assert not looked_at.has_shown(*next_theirs)
        here, other = Enu(*next_mine, UP_M), Enu(*next_theirs, UP_M)
        for second in range(3):
            looked_at.note(here, (step * 4 + second) * S)
            looked_at.note(other, (step * 4 + second) * S)


def test_who_is_held_back_looks_on_the_other_side_meanwhile_and_on_that_side_again_later() -> None:
    here, start = Enu(0, 0, UP_M), Enu(0, 0, UP_M)
    phone, looked_at = heard_once(Enu(80, 0, 0), start), LookedAt(VIEW_M, height_m=UP_M)
    look = LookAround(looked_at)
    looked_at.note(here, 0)
    towards = look.next_place(1, phone, here, 0)
    assert towards is not None
    for second in range(1, 5):
        chosen = look.next_place(1, phone, here, second * S)
    assert chosen is not None
    assert chosen[0] * towards[0] + chosen[1] * towards[1] < 0.5 * math.hypot(*chosen) * math.hypot(*towards) + 1e-6
    moved = Enu(here.east + chosen[0] / 4, here.north + chosen[1] / 4, UP_M)
    assert look.next_place(1, phone, moved, 12 * S) != towards
    assert look.next_place(1, phone, here, 40 * S) == towards


def test_who_turns_is_not_held_back() -> None:
    phone, looked_at, here = (
        heard_once(Enu(80, 0, 0), Enu(0, 0, UP_M)),
        LookedAt(VIEW_M, height_m=UP_M),
        Enu(0, 0, UP_M),
    )
    look = LookAround(looked_at)
    looked_at.note(here, 0)
    towards = look.next_place(1, phone, here, 0)
    assert look.next_place(1, phone, here, S) == towards
    assert look.next_place(1, phone, here, 2 * S) == towards


def test_who_wants_to_another_point_is_held_back_only_after_it_has_stood_as_long_again() -> None:
    headway, here = Headway(), Enu(0, 0, UP_M)
    held = [headway.is_held_back((100.0 if second < 3 else -100.0, 0.0), here, second * S) for second in range(7)]
    assert held == [False] * 6 + [True]


def test_who_was_held_back_on_the_way_to_one_survivor_looks_for_another_one_in_all_directions() -> None:
    here = Enu(0, 0, UP_M)
    phone, looked_at = heard_once(Enu(80, 0, 0), here), LookedAt(VIEW_M, height_m=UP_M)
    looked_at.note(here, 0)
    look = LookAround(looked_at)
    places = [look.next_place(1, phone, here, second * S) for second in range(5)]
    assert places[-1] != places[0]
    assert look.next_place(2, phone, here, 5 * S) == places[0]


def test_who_stands_at_the_very_place_is_not_held_back_from_it() -> None:
    looked_at = LookedAt(VIEW_M, height_m=UP_M)
    look, phone = LookAround(looked_at), heard_once(Enu(0, 0, 0), Enu(0, 0, UP_M))
    place = look.next_place(1, phone, Enu(0, 0, UP_M), 0)
    assert place is not None
    at = Enu(*place, UP_M)
    assert [look.next_place(1, phone, at, second * S) for second in range(1, 6)] == [place] * 5
