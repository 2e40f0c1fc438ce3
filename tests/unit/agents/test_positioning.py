"""Fixes that err by much are averaged, those that do not are taken as they are; and where a UAV is while GPS is out."""

import statistics

import pytest

from agents.positioning import DeadReckoning, SteadyFix, gain
from fanet_mw.bus.messages import Gps, Inertial
from fanet_mw.rng import stream
from fanet_mw.units import MS, Enu, S

VELOCITY = Enu(8.0, 0.0, 0.0)
EAST = Enu(10, 0, 0)


def test_small_errors_are_left_alone() -> None:
    fixes = SteadyFix(sigma_m=1.5, range_m=250)
    assert fixes.position(Gps(0, Enu(0, 0, 0), VELOCITY)) == Enu(0, 0, 0)
    assert fixes.position(Gps(200 * MS, Enu(3, 1, 0), VELOCITY)) == Enu(3, 1, 0)
    assert gain(sigma_m=5.0, range_m=250) == 1.0


@pytest.mark.parametrize("sigma_m", [10.0, 15.0, 30.0])
def test_in_straight_flight_the_estimate_errs_by_a_hundredth_of_the_range(sigma_m: float) -> None:
    fixes, random = SteadyFix(sigma_m=sigma_m, range_m=250), stream(1, "steady_fix_test", 0)
    errors = []
    for count in range(20_000):
        true = Enu(8.0 * 0.2 * count, 0.0, 50.0)
        noisy = Enu(*(axis + random.gauss(0.0, sigma_m) for axis in true))
        here = fixes.position(Gps(count * 200 * MS, noisy, VELOCITY))
        if count > 2_000:
            errors.append(here.minus(true).east)
    assert statistics.pstdev(errors) == pytest.approx(2.5, rel=0.25)
    assert statistics.fmean(errors) == pytest.approx(0.0, abs=0.5)


def test_while_gps_speaks_nothing_stands_in_for_it() -> None:
    reckoning = DeadReckoning()
    reckoning.fix(Gps(S, Enu(0, 0, 50), EAST))
    assert reckoning.velocity(Inertial(S + 400 * MS, EAST)) is None


def test_in_an_outage_the_velocity_moves_the_position_on() -> None:
    reckoning = DeadReckoning()
    reckoning.fix(Gps(S, Enu(0, 0, 50), EAST))
    fixes = [reckoning.velocity(Inertial(S + k * 200 * MS, EAST)) for k in range(3, 11)]
    last = fixes[-1]
    assert last is not None
    assert abs(last.position.east - 20) < 1e-6
    assert last.velocity == EAST


def test_without_any_fix_before_there_is_no_position() -> None:
    assert DeadReckoning().velocity(Inertial(9 * S, EAST)) is None


def test_noise_of_fixes_is_averaged_before_an_outage_begins() -> None:
    reckoning = DeadReckoning()
    for k in range(100):
        reckoning.fix(Gps(k * 200 * MS, Enu(2.0 * k + (3 if k % 2 else -3), 0, 50), EAST))
    found = reckoning.velocity(Inertial(100 * 200 * MS + S, EAST))
    assert found is not None
    assert abs(found.position.east - 210) < 1
