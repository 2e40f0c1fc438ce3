"""A UAV knows when its battery only just takes it home."""

import math

import pytest

from agents.mission.flight.endurance import Endurance
from fanet_mw.units import STILL, Enu, S

HOME = Enu(0.0, 0.0, 50.0)


def test_the_margin_is_what_is_left_above_the_reserve_and_the_way_home() -> None:
    battery = Endurance(HOME, speed_m_s=10.0, reserve=0.2)
    assert battery.margin(Enu(1000, 0, 50)) == 1.0, "nobody has told yet"
    for second in range(31):
        battery.read(0.8 - 0.001 * second, now_ns=second * S)
    # 0.1 % a second; 1,000 m take 100 s and 50 m down take 50 s, with a fifth more: 180 s
    assert battery.margin(Enu(1000, 0, 50)) == pytest.approx(0.77 - 0.2 - 0.18)
    assert battery.margin(Enu(0, 0, 0)) == pytest.approx(0.57)


def test_who_is_far_away_turns_back_earlier_than_who_is_near() -> None:
    near, far = (Endurance(HOME, speed_m_s=10.0, reserve=0.2) for _ in range(2))
    turned: dict[str, int] = {}
    for second in range(500):
        for name, battery, place in (("near", near, Enu(100, 0, 50)), ("far", far, Enu(1500, 0, 50))):
            battery.read(0.7 - 0.001 * second, now_ns=second * S)
            if battery.margin(place) == 0.0:
                turned.setdefault(name, second)
    assert turned["far"] < turned["near"] - 150


@pytest.mark.parametrize(
    ("wind", "way_s"),
    [
        pytest.param(STILL, 100, id="in still air"),
        pytest.param(Enu(15, 0, 0), 250, id="against the wind, 4 m/s are left"),
        pytest.param(Enu(-15, 0, 0), 100, id="before the wind, no faster than it flies"),
        pytest.param(Enu(0, 17, 0), 1000 / math.sqrt(19**2 - 17**2), id="across the wind, it leans into it"),
    ],
)
def test_the_way_home_takes_as_long_as_the_wind_lets_it(wind: Enu, way_s: float) -> None:
    battery = Endurance(HOME, speed_m_s=10.0, reserve=0.2, airspeed_m_s=19.0)
    battery.on_wind(wind)
    for second in range(31):  # as fast through the air as on the way home
        battery.read(0.9 - 0.001 * second, now_ns=second * S, velocity=Enu(-1000 / way_s, 0, 0))
    needed = 0.87 - 0.2 - battery.margin(Enu(1000, 0, 0))
    assert needed == pytest.approx(1.2 * 0.001 * way_s, rel=0.01)


def test_a_way_home_that_takes_more_power_than_the_flight_lately_is_reckoned_so() -> None:
    battery = Endurance(HOME, speed_m_s=10.0, reserve=0.2, airspeed_m_s=19.0)
    battery.on_wind(Enu(15, 0, 0))
    for second in range(31):  # with the wind
        battery.read(0.9 - 0.001 * second, now_ns=second * S, velocity=Enu(15, 0, 0))
    needed = 0.87 - 0.2 - battery.margin(Enu(400, 0, 0))
    assert needed > 1.2 * 0.001 * 100 * 1.6, "19 m/s through the air take 1.7 of what hovering takes"
