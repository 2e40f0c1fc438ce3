"""How often telemetry crosses the air: never so often that it takes the air from the swarm."""

from typing import Any

import pytest

from agents.ground_control.telemetry_pace import SHARE, pace_of
from fanet_mw.units import S


@pytest.mark.parametrize("count", [2, 9, 45, 100, 250])
@pytest.mark.parametrize("protocol", ["flooding", "rounds", "aodv", "direct"])
def test_telemetry_of_all_uavs_takes_at_most_a_tenth_of_the_air(make_scenario: Any, count: int, protocol: str) -> None:
    keys = {"nodes.count": count, "routing.protocol": protocol, "clusters.count": 1}
    pace = pace_of(make_scenario(**keys))
    assert pace.share <= SHARE * 1.0001
    assert pace.interval_ns >= S
