"""What others say of survivors is believed up to its bounds, on both sides of the area, and no further."""

import math

import pytest

from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB, PhoneModel
from agents.mission.finding.plausibility import Plausibility
from fanet_mw.units import US, Enu, S
from fanet_mw.wire.search_messages import Roll
from fanet_mw.wire.survivors import Found, Standing, Survivor

MODEL = PhoneModel(power_dbm=15, exponent=3, shadowing_db=4, offset_db=1, threshold_dbm=-90, half_m=250.0)
STRONGEST_DBM = 15 + 18 + 4 * 4 - REFERENCE_LOSS_DB
REACH_M = math.pow(10.0, (STRONGEST_DBM + 90) / 30)
NOW_NS = 100 * S


def report(east: float = 0.0, north: float = 0.0, *, dbm: float = -70.0, ahead_us: int = 0) -> Survivor:
    return Survivor(NOW_NS // US + ahead_us, 1, 9, Enu(east, north, 60), dbm)


def find(east: float = 0.0, north: float = 0.0, *, ahead_us: int = 0) -> Found:
    return Found(NOW_NS // US + ahead_us, 1, east, north, 1.0, 0.0, 1.0, 9, Standing.CONFIRMED)


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_reporter_is_no_farther_from_the_area_than_the_strongest_phone_is_received(sign: int) -> None:
    bounds, most_m = Plausibility(MODEL), 250.0 + REACH_M
    for beyond_m, held in ((-0.01, True), (0.01, False)):
        at_m = sign * (most_m + beyond_m)
        assert bounds.holds(report(at_m, 0.0), now_ns=NOW_NS) is held
        assert bounds.holds(report(0.0, at_m), now_ns=NOW_NS) is held


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_survivor_is_stated_no_more_than_100_m_outside_the_area(sign: int) -> None:
    bounds = Plausibility(MODEL)
    for at_m, held in ((350.0, True), (350.01, False)):
        assert bounds.holds(find(sign * at_m, 0.0), now_ns=NOW_NS) is held
        assert bounds.holds(find(0.0, sign * at_m), now_ns=NOW_NS) is held


def test_no_power_is_greater_than_that_of_the_strongest_phone_at_1_m() -> None:
    bounds = Plausibility(MODEL)
    assert bounds.holds(report(dbm=STRONGEST_DBM), now_ns=NOW_NS)
    assert not bounds.holds(report(dbm=STRONGEST_DBM + 0.001), now_ns=NOW_NS)


def test_what_is_told_is_no_more_than_a_second_ahead_of_the_own_clock() -> None:
    bounds = Plausibility(MODEL)
    for told in (report, find):
        assert bounds.holds(told(ahead_us=1_000_000), now_ns=NOW_NS)
        assert not bounds.holds(told(ahead_us=1_000_001), now_ns=NOW_NS)


def test_whatever_is_no_statement_of_a_place_is_left_to_others() -> None:
    assert Plausibility(MODEL).holds(Roll(0, 1, 1, (), frozenset()), now_ns=NOW_NS)


def test_phones_that_are_received_anywhere_leave_reporters_anywhere_on_earth_and_deaf_receivers_beside_the_area() -> (
    None
):
    everywhere = Plausibility(MODEL._replace(threshold_dbm=-1000.0))
    assert everywhere.holds(report(250.0 + 1e7), now_ns=NOW_NS)
    assert not everywhere.holds(report(252.0 + 1e7), now_ns=NOW_NS)
    deaf = Plausibility(MODEL._replace(threshold_dbm=200.0))
    assert deaf.holds(report(251.0), now_ns=NOW_NS)
    assert not deaf.holds(report(251.01), now_ns=NOW_NS)
