"""A UAV knows when its battery only just takes it home."""

import pytest

from agents.mission.flight.endurance import Endurance
from fanet_mw.units import Enu, S

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
