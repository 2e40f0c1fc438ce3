"""The descent of a UAV that listens for a survivor: how far down, one at a time, and up again."""

import math
from collections.abc import Callable

import pytest
from search_board import OPEN, UP_M

from agents.mission.finding.phone_localization import Estimate
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.tasking.voice_descent import VoiceDescent, descent_ns, listening_height_m, turned_rad
from fanet_mw.motion import Motion
from fanet_mw.scenario import Scenario
from fanet_mw.units import STILL, Enu, NodeId, S

MakeScenario = Callable[..., Scenario]
PLACE = Estimate(100.0, 50.0, 400.0, 0.0, 400.0)
HEARD_M = 10 ** (23 / 20)
"""A call of 88 dB, in rotors of 80 dB less an array's gain of 15 dB."""


class Descent:
    """One UAV, which is at once where it is told to be, except for its height, and its clock."""

    def __init__(self, make_scenario: MakeScenario, node: int = 5, **keys: object) -> None:
        wanted = {"nodes.altitude_m": UP_M, "sensors.voice_hz": 2, **keys}
        self.at, self.now_ns = Enu(PLACE.east_m, PLACE.north_m, UP_M), 0
        self.own_motion, self.neighbors = OwnMotion(self.at, OPEN), NeighborMotions()
        self.listening = VoiceDescent(
            make_scenario(**wanted), NodeId(node), self.own_motion, self.neighbors, speed_m_s=10.0
        )

    def fly(
        self,
        seconds: int,
        *,
        seen: bool = False,
        misses_m: float = 0.0,
        survivor: int = 1,
        place: Estimate = PLACE,
    ) -> list[float]:
        """The heights at which it is, second by second."""
        heights = []
        for _ in range(seconds):
            self.now_ns += S
            around = Enu(place.east_m + 14, place.north_m, UP_M)
            goal = self.listening.goal(survivor, place, around, seen=seen, misses_m=misses_m, now_ns=self.now_ns)
            up_m = self.at.up + max(-2.5, min(2.5, goal.up - self.at.up))
            near = place.distance_m(self.at) < 100
            self.at = goal._replace(up=up_m) if near else self.at._replace(up=up_m)
            self.own_motion.position = self.at
            heights.append(up_m)
        return heights


def test_it_goes_down_to_where_it_hears_as_far_to_the_side_as_down_and_up_again_for_the_next_survivor(
    make_scenario: MakeScenario,
) -> None:
    uav = Descent(make_scenario)
    heights = uav.fly(60)
    assert heights == sorted(heights, reverse=True)
    assert heights[-1] == pytest.approx(HEARD_M / math.sqrt(2))
    assert uav.fly(40, survivor=2, place=PLACE._replace(east_m=500.0))[-1] == UP_M


def test_the_spiral_down_there_leaves_no_place_unheard_and_closes_in_on_a_caller(make_scenario: MakeScenario) -> None:
    uav = Descent(make_scenario)
    low_m = HEARD_M / math.sqrt(2)
    way = [(uav.at.east, uav.at.north) for _ in range(75) if uav.fly(1)[0] < low_m + 0.5]
    for angle in range(0, 360, 15):
        for out_m in range(0, 26, 5):
            spot = (
                PLACE.east_m + out_m * math.cos(math.radians(angle)),
                PLACE.north_m + out_m * math.sin(math.radians(angle)),
            )
            assert min(math.dist(spot, place) for place in way) <= low_m + 1.0
    uav.fly(1, seen=True)
    assert math.dist((uav.at.east, uav.at.north), (PLACE.east_m, PLACE.north_m)) < low_m


def test_two_at_one_place_take_turns_below_half_of_the_height(make_scenario: MakeScenario) -> None:
    for other, height_m, lowest_m in ((3, UP_M / 2, UP_M / 2), (9, UP_M / 2, 10.0), (9, 10.0, UP_M / 2)):
        uav = Descent(make_scenario, node=5)
        motion = Motion(Enu(PLACE.east_m + 20, PLACE.north_m, height_m), STILL, 0)
        reached = []
        for _ in range(60):
            uav.neighbors.on_hello(other, motion._replace(at_ns=uav.now_ns))
            reached += uav.fly(1)
        assert min(reached) == pytest.approx(lowest_m, abs=1.0), f"node {other} is at {height_m:g} m"
        uav.fly(20)
        assert uav.at.up == pytest.approx(HEARD_M / math.sqrt(2)), "the other one has not been heard of for a while"


def test_whose_place_keeps_it_too_far_away_to_hear_stays_up_and_comes_up(make_scenario: MakeScenario) -> None:
    uav = Descent(make_scenario)
    assert uav.fly(40, misses_m=1.1 * HEARD_M / math.sqrt(2)) == [UP_M] * 40
    assert uav.fly(60, misses_m=0.9 * HEARD_M / math.sqrt(2))[-1] < 11
    assert uav.fly(40, misses_m=1.1 * HEARD_M / math.sqrt(2))[-1] == UP_M


def test_a_uav_that_stands_beside_the_place_keeps_nobody_from_going_down(
    make_scenario: MakeScenario,
) -> None:
    uav = Descent(make_scenario, node=5)
    for _ in range(60):
        uav.neighbors.on_hello(3, Motion(Enu(PLACE.east_m + 40, PLACE.north_m, 0.2), STILL, uav.now_ns))
        uav.fly(1)
    assert uav.at.up == pytest.approx(HEARD_M / math.sqrt(2))


def test_a_camera_looks_from_above_first_and_keeps_whom_it_sees_in_view_from_there(
    make_scenario: MakeScenario,
) -> None:
    uav = Descent(make_scenario, **{"sensors.camera_hz": 2})
    assert set(uav.fly(10)) == {UP_M}
    assert uav.fly(10)[-1] < UP_M - 20
    assert uav.fly(20, seen=True)[-1] == UP_M


@pytest.mark.parametrize(
    ("keys", "height_m"),
    [
        ({}, HEARD_M / math.sqrt(2)),
        ({"sensors.voice_hz": 0}, None),
        ({"sensors.voice_rotor_db": 60}, None),  # it hears 141 m far, from any height of the search
        ({"sensors.voice_rotor_db": 83}, 8.0),
        ({"sensors.voice_rotor_db": 86}, None),  # it hears 7 m far, and goes down to 8 m at most
    ],
)
def test_a_uav_goes_down_only_if_that_brings_the_ground_within_hearing(
    make_scenario: MakeScenario, keys: dict[str, object], height_m: float | None
) -> None:
    scenario = make_scenario(**{"nodes.altitude_m": UP_M, "sensors.voice_hz": 2, **keys})
    assert listening_height_m(scenario) == (None if height_m is None else pytest.approx(height_m))
    assert (descent_ns(scenario) > 0) == (height_m is not None)


@pytest.mark.parametrize(("growth_m_s", "speed_m_s"), [(0.5, 3.0), (0.9, 10.0), (2.0, 5.0)])
def test_a_spiral_turns_no_faster_than_its_uav_can_fly(growth_m_s: float, speed_m_s: float) -> None:
    """At full angular speed as long as that is slower, and then at the speed of the UAV."""
    turns_rad_s = 0.35

    def angle(t_s: float) -> float:
        return turned_rad(turns_rad_s * t_s, growth_m_s * t_s, growth_m_s, widest_m=speed_m_s / turns_rad_s)

    wide_s = speed_m_s / turns_rad_s / growth_m_s
    assert angle(1.001 * wide_s) == pytest.approx(angle(wide_s), rel=2e-3), "it does not jump there"
    for second in range(1, 100):
        turned = (angle(second + 0.001) - angle(second - 0.001)) / 0.002
        fastest = min(turns_rad_s, speed_m_s / (growth_m_s * second))
        assert turned == pytest.approx(fastest, rel=1e-3), second
