"""Where cameras have looked lately, and what that says of a phone whose owner nobody has seen there."""

import math

import pytest
from search_board import MODEL, UP_M

from agents.mission.finding.known_survivors import KnownSurvivor, KnownSurvivors
from agents.mission.finding.looked_at import LookedAt
from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB, Estimate, PhoneFilter
from fanet_mw.units import US, Enu, S
from fanet_mw.wire.survivors import Found, Standing

VIEW_M = (40.0, 40.0)


def looks(*at: Enu, since_s: int = 0) -> LookedAt:
    """Cameras were at these places, a second after each other."""
    looked_at = LookedAt(VIEW_M, height_m=UP_M)
    for second, here in enumerate(at, since_s):
        looked_at.note(here, second * S)
    return looked_at


def heard(*at: Enu, truth: Enu, looked_at: LookedAt) -> KnownSurvivor:
    known = KnownSurvivor(PhoneFilter(MODEL), looked_at=looked_at)
    for node, here in enumerate(at, 1):
        known.filter.on_rssi(
            node, here, MODEL.power_dbm - REFERENCE_LOSS_DB - 30 * math.log10(here.minus(truth).norm())
        )
    return known


def told(place: Estimate, *, node: int, t_s: int) -> Found:
    return Found(t_s * S // US, 1, *place, node, Standing.ESTIMATED)


def place(east_m: float, sigma_m: float) -> Estimate:
    return Estimate(east_m, 0.0, sigma_m**2, 0.0, sigma_m**2)


def test_a_place_is_shown_after_three_looks_and_for_two_minutes() -> None:
    looked_at = looks(Enu(0, 0, UP_M), Enu(10, 0, UP_M))
    assert not looked_at.has_shown(0, 0)
    looked_at.note(Enu(20, 0, UP_M), 2 * S)
    assert looked_at.has_shown(0, 0)
    assert not looked_at.has_shown(-40, 0), "once"
    looked_at.note(Enu(500, 0, UP_M), 122 * S - 1)
    assert looked_at.has_shown(0, 0)
    looked_at.note(Enu(500, 0, UP_M), 122 * S)
    assert not looked_at.has_shown(0, 0), "whoever walks may be there now"
    looked_at.note(Enu(0, 0, UP_M), 123 * S)
    assert not looked_at.has_shown(0, 0), "one look"


def test_what_is_remembered_is_bounded_whatever_hellos_say() -> None:
    looked_at = LookedAt(VIEW_M, height_m=UP_M)
    for second in range(301):
        for other in range(20):
            looked_at.note(Enu(1000 * second, 1000 * other, UP_M), second * S)
    assert looked_at.sides(299_000, 19_000)
    assert len(looked_at._cells) <= 20 * 150 * 13, "of two minutes and a half"
    for other in range(5_000):
        looked_at.note(Enu(1000 * other, -5000, UP_M), 300 * S)
    assert len(looked_at._cells) < 50_020
    assert looked_at.sides(299_000, 19_000), "what was seen before is not pushed out"


@pytest.mark.parametrize(("up_m", "shown_m"), [(UP_M, 20), (2 * UP_M, 20), (UP_M / 2, 0), (0.0, -20)])
def test_a_camera_shows_less_from_below_and_nothing_on_the_ground(up_m: float, shown_m: float) -> None:
    looked_at = looks(*[Enu(1, 1, up_m)] * 3)
    assert [east_m for east_m in (0, 20, 40) if looked_at.has_shown(east_m, 0)] == list(range(0, int(shown_m) + 1, 20))


def test_an_image_shows_more_to_the_east_and_west_than_to_the_north_and_south_as_it_is_wide() -> None:
    looked_at = LookedAt((65.0, 36.6), height_m=UP_M)
    for second in range(3):
        looked_at.note(Enu(0, 0, UP_M), second * S)
    assert looked_at.has_shown(40, 20)
    assert not looked_at.has_shown(20, 40)
    assert not looked_at.has_shown(60, 20), "nobody is expected at the very edge of an image"


def test_a_place_is_looked_at_from_as_many_sides_as_it_was_passed_on_and_sides_are_forgotten() -> None:
    looked_at = LookedAt(VIEW_M, height_m=UP_M)
    for second, (north_m, sides) in enumerate(((-15, 1), (-12, 1), (15, 2), (18, 2)), 1):
        looked_at.note(Enu(10, north_m, UP_M), second * S)
        assert looked_at.sides(0, 0) == sides, north_m
    assert looked_at.sides(200, 0) == 0
    looked_at.note(Enu(500, -15, UP_M), 124 * S)
    assert looked_at.sides(0, 0) == 0
    looked_at.note(Enu(10, -15, UP_M), 200 * S)
    assert looked_at.sides(0, 0) == 1


def test_without_a_camera_no_place_is_shown() -> None:
    looked_at = LookedAt()
    for second in range(9):
        looked_at.note(Enu(0, 0, UP_M), second * S)
    assert not looked_at.has_camera
    assert not looked_at.has_shown(0, 0)


def test_a_phone_heard_from_a_straight_course_is_on_the_side_where_no_camera_has_looked() -> None:
    truth, course = Enu(0, 120, 0), [Enu(east_m, 0, UP_M) for east_m in range(-150, 151, 60)]
    both = heard(*course, truth=truth, looked_at=LookedAt()).place()
    assert both is not None
    assert abs(both.north_m) < 30
    assert both.sigma_m > 80
    south = looks(*(Enu(east_m, -y, UP_M) for y in (80, 110, 140, 170) for east_m in range(-150, 151, 12)))
    known = heard(*course, truth=truth, looked_at=south)
    known.looked_at.note(Enu(0, 0, UP_M), 120 * S)
    known.looked_at.note(Enu(0, 0, UP_M), 121 * S)
    known.looked_at.note(Enu(0, 0, UP_M), 122 * S)
    assert known.looked_at.has_shown(both.east_m, both.north_m)
    at = known.place()
    assert at is not None
    assert at.north_m > 60
    assert at.sigma_m < both.sigma_m
    assert known.filter.estimate_by_power() == both, "what powers say stays as it is"


def test_where_all_places_were_shown_the_powers_decide_as_before() -> None:
    truth, around = Enu(5, 5, 0), [Enu(60, 0, UP_M), Enu(-40, 40, UP_M), Enu(-30, -60, UP_M)]
    vague = heard(*around, truth=truth, looked_at=LookedAt())
    everywhere = LookedAt(VIEW_M, height_m=UP_M)
    for second in range(3):
        for east_m in range(-500, 501, 40):
            for north_m in range(-500, 501, 40):
                everywhere.note(Enu(east_m, north_m, UP_M), second * S)
    known = heard(*around, truth=truth, looked_at=everywhere)
    before, now = vague.place(), known.place()
    assert before is not None
    assert now is not None
    assert now.distance_m(before.at) < 15


def test_an_announced_place_counts_for_nothing_once_cameras_have_looked_there() -> None:
    truth = Enu(200, 0, 0)
    known = heard(Enu(100, 0, UP_M), truth=truth, looked_at=LookedAt(VIEW_M, height_m=UP_M))
    own = known.place()
    assert own is not None
    known.announced = told(place(-300, 5), node=7, t_s=1)
    assert known.place() == place(-300, 5), "more exact than its own"
    for second in range(3):
        known.looked_at.note(Enu(-300, 0, UP_M), second * S)
    assert known.place() == own


def test_an_estimate_yields_to_a_more_exact_one_and_to_what_its_own_node_learns_later() -> None:
    survivors = KnownSurvivors(MODEL)
    for found, is_kept in (
        (told(place(0, 20), node=7, t_s=5), True), (told(place(50, 30), node=8, t_s=6), False),
        (told(place(60, 40), node=7, t_s=4), False), (told(place(70, 10), node=8, t_s=3), True),
        (told(place(80, 50), node=8, t_s=9), True), (told(place(90, 60), node=7, t_s=10), False),
    ):  # fmt: skip
        survivors.on_found(found, now_ns=0)
        assert (survivors.by_id[1].announced == found) == is_kept, found
