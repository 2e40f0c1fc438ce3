"""The estimate of a phone's place from several RSSI readings."""

import math

from hypothesis import given
from hypothesis import strategies as st

from agents.mission.finding.least_squares import PowerReading, estimate
from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB
from fanet_mw.units import Enu

POWER_DBM, EXPONENT = 15.0, 3.0


def heard_from(place: Enu, position: Enu) -> PowerReading:
    loss_db = REFERENCE_LOSS_DB + 10 * EXPONENT * math.log10(max(1.0, position.minus(place).norm()))
    return PowerReading(position, POWER_DBM - loss_db)


def located(readings: list[PowerReading]) -> Enu:
    return estimate(readings, phone_power_dbm=POWER_DBM, exponent=EXPONENT)


@given(east=st.floats(-80, 80), north=st.floats(-80, 80))
def test_without_shadowing_four_readings_around_a_phone_give_its_place(east: float, north: float) -> None:
    phone = Enu(east, north, 0)
    corners = [Enu(x, y, 50) for x in (-100, 100) for y in (-100, 100)]
    assert located([heard_from(phone, corner) for corner in corners]).minus(phone).norm() < 2


def test_one_reading_gives_the_place_of_the_hearer() -> None:
    assert located([PowerReading(Enu(10, 20, 50), -70)]) == Enu(10, 20, 0)


def test_hearers_in_a_row_leave_the_side_open_but_give_a_finite_answer() -> None:
    row = [heard_from(Enu(0, 60, 0), Enu(x, 0, 50)) for x in (-100, 0, 100)]
    place = located(row)
    assert abs(place.east) < 30
    assert abs(place.north) < 300


@given(st.lists(st.tuples(st.floats(-2000, 2000), st.floats(-2000, 2000), st.floats(-130, 30)), min_size=1, max_size=9))
def test_any_readings_give_a_finite_place(raw: list[tuple[float, float, float]]) -> None:
    place = located([PowerReading(Enu(x, y, 50), rssi) for x, y, rssi in raw])
    assert math.isfinite(place.east)
    assert math.isfinite(place.north)
