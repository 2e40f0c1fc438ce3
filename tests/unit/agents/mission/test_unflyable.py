"""What a search cannot do is said before the flight, with the key, its value and the bound."""

from collections.abc import Callable

import pytest

from agents.mission.searcher import unflyable
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from sim.scenarios import catalog


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"mobility.speed_m_s": 10.0}, []),
        ({"mobility.speed_m_s": 10.5}, ["mobility.speed_m_s = 10.5", "<= mission.approach_speed_m_s = 10"]),
        ({"mission.approach_speed_m_s": (6.0, 12.0), "mobility.speed_m_s": 7.5}, ["mission.approach_speed_m_s = 6"]),
        ({"sensors.camera_hz": 2.0, "nodes.altitude_m": 100.0}, []),
        ({"sensors.camera_hz": 2.0, "nodes.altitude_m": 400.0}, ["nodes.altitude_m = 400", "must be >= 10%"]),
        ({"nodes.altitude_m": 400.0}, []),
    ],
)
def test_speeds_and_heights_that_cannot_work_are_named(
    make_scenario: Callable[..., Scenario], keys: dict[str, object], said: list[str]
) -> None:
    problems = [*unflyable(make_scenario(**keys))]
    assert len(problems) == bool(said)
    assert all(part in problems[0] for part in said)


def test_a_search_that_cannot_be_flown_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"mobility.speed_m_s = 20.*must be <= mission.approach_speed_m_s = 10"):
        catalog.find("rescue", ("mobility.speed_m_s=20",))
