"""Where a UAV takes itself to be while GPS is out."""

from agents.positioning.dead_reckoning import DeadReckoning
from fanet_mw.bus.messages import Gps, Inertial
from fanet_mw.units import MS, Enu, S

EAST = Enu(10, 0, 0)


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
