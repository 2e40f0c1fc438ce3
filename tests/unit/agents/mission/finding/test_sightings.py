"""People on a hillside are seen where they are."""

import math

import pytest
from kit import MakeScenario
from seeing_uav import MODEL, UP_M

from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.sightings import Sightings
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.onboard_map import OnboardMap
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from fanet_mw.bus.messages import Person
from fanet_mw.trace import Sighted
from fanet_mw.units import STILL, Enu, NodeId, S

SLOPE = OnboardMap((), tuple(tuple(0.5 * 50.0 * column for column in range(-4, 5)) for _ in range(9)), 50.0)
"""It rises eastward, by one in two."""


@pytest.mark.parametrize("east_m", [-60.0, 0.0, 40.0])
def test_a_person_on_a_hillside_is_seen_where_the_ray_meets_it(make_scenario: MakeScenario, east_m: float) -> None:
    own, outbox = OwnMotion(Enu(0, 0, UP_M), KnownObstacles(SLOPE)), Outbox()
    own.fix(Enu(0, 0, UP_M), STILL, now_ns=S)
    scenario = make_scenario(**{"sensors.camera_hz": 2.0, "sensors.camera_fov_deg": 90.0})
    sightings = Sightings(scenario, NodeId(1), KnownSurvivors(MODEL), own, outbox)
    down_m = UP_M - SLOPE.ground_m(east_m, 10.0)
    elevation_rad = -math.atan2(down_m, math.hypot(east_m, 10.0))
    sightings.camera([Person(math.atan2(east_m, 10.0), elevation_rad, 20.0)], now_ns=S)
    (seen,) = [record for record in outbox.records if isinstance(record, Sighted)]
    assert (seen.east_m, seen.north_m) == pytest.approx((east_m, 10.0), abs=0.1)
