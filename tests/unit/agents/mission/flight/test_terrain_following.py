"""A UAV keeps its height above steep ground: it climbs ahead, and flies slower where it cannot climb fast enough."""

import math

import pytest

from agents.mission.flight.terrain_following import TerrainFollowing
from agents.mission.flight.velocity_choice import VelocityChoice
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.onboard_map import OnboardMap
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw.units import STILL, Enu, S

STEP_S, CELL_M, POINTS = 0.1, 10.0, 201
UP_M = 65.0


def hills(high_m: float, steepest: float) -> OnboardMap:
    """Waves across the way whose slope is at most `steepest`, with crests this high above the troughs."""
    per_m = steepest / (high_m / 2)
    row = tuple(high_m / 2 * (1 - math.cos(per_m * CELL_M * (i - POINTS // 2))) for i in range(POINTS))
    return OnboardMap((), (row,) * POINTS, CELL_M)


def heights_flown(ground: OnboardMap, *, speed_m_s: float) -> tuple[list[float], float]:
    """The heights above ground on the way across, and the mean speed."""
    obstacles = KnownObstacles(ground)
    at = Enu(-900.0, 0.0, ground.ground_m(-900.0, 0.0) + UP_M)
    own, climbs, heights = OwnMotion(at, obstacles), 0.0, []
    choice = VelocityChoice(own, obstacles, most_m_s=speed_m_s, hard=[], soft=[])
    for step in range(4000):
        now_ns = round(step * STEP_S * S)
        wanted = choice.velocity(Enu(2000.0, 0.0, UP_M), STILL, now_ns)
        change = max(-5 * STEP_S, min(5 * STEP_S, wanted.up - climbs))  # as fast as the kinematic engine turns
        climbs += change
        at = Enu(at.east + wanted.east * STEP_S, at.north, at.up + climbs * STEP_S)
        own.fix(at, wanted._replace(up=climbs), now_ns=now_ns)
        heights.append(at.up - ground.ground_m(at.east, at.north))
        if at.east > 900:
            break
    return heights, 1800 / (len(heights) * STEP_S)


@pytest.mark.parametrize("speed_m_s", [7.5, 10.0])
@pytest.mark.parametrize(("high_m", "steepest"), [(40.0, 0.2), (150.0, 0.51), (80.0, 0.8)])
def test_the_height_over_hills_holds_within_15_m(speed_m_s: float, high_m: float, steepest: float) -> None:
    heights, mean_m_s = heights_flown(hills(high_m, steepest), speed_m_s=speed_m_s)
    assert max(abs(height - UP_M) for height in heights) <= 15
    assert mean_m_s >= 0.6 * speed_m_s, "it does not creep"


def test_whom_others_draw_towards_a_steep_slope_climbs_before_it() -> None:
    ground = OnboardMap((), ((0.0,) * 11 + (100.0,) * 10,) * 21, 50.0)  # from 0 to 100 m within 50 m
    obstacles = KnownObstacles(ground)
    drawn = Enu(10.0, 0.0, 0.0)
    for east_m, climbs in ((-60.0, True), (-400.0, False)):
        own = OwnMotion(Enu(east_m, 0.0, UP_M), obstacles)
        assert (TerrainFollowing(own, obstacles).climb_m_s(UP_M, drawn, 0) == pytest.approx(4.0)) == climbs


def test_a_uav_flies_at_full_speed_over_level_ground_and_gentle_hills() -> None:
    for ground in (hills(40.0, 0.2), OnboardMap()):
        assert heights_flown(ground, speed_m_s=10.0)[1] == pytest.approx(10.0, rel=0.02)
