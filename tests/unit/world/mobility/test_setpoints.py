"""What UAVs do when their own computers fly them: each kind of setpoint, the ground, and a crash."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fanet_mw.bus.messages import Gps, Message, Poses, Setpoint, SetpointKind
from fanet_mw.bus.radio_control import Cut, Mishap, MishapKind
from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Collided, FlightModeChanged
from fanet_mw.units import Enu, NodeId, S
from sim.world.flight_recorder import SwarmFlight
from sim.world.world import WorldActor

MakeScenario = Callable[..., Scenario]
NAMES = Topics("m")
STILL = Enu(0.0, 0.0, 0.0)


class Flying:
    """A world, its clock, and what it has said."""

    def __init__(self, make_scenario: MakeScenario, **keys: Any) -> None:
        given = {"nodes.count": 2, "nodes.spacing_m": 100, "mobility.model": "onboard", "world.area_m": 1000,
                 "world.navigation": "perfect"}  # fmt: skip
        self.world = WorldActor(make_scenario(**given | keys), "m")
        self.said: list[tuple[str, Message]] = []
        self.now_ns = 0
        self.world.start(0)

    def ask(self, node: int, kind: SetpointKind, place: Enu = STILL, *, speed_m_s: float = 5.0, v: Enu = STILL) -> None:
        self.world.receive(NAMES.setpoint(node), Setpoint(self.now_ns, place, speed_m_s, kind, v), self.now_ns)

    def fly(self, seconds: float) -> "Flying":
        until_ns = self.now_ns + round(seconds * S)
        while (wake_ns := self.world.next_wake_ns()) is not None and wake_ns <= until_ns:
            self.world.wake(wake_ns)
            self.said += self.world.outbox
            self.world.outbox.clear()
        self.now_ns = until_ns
        return self

    def at(self, node: int) -> np.ndarray:
        return self._state(node)[:3]

    def velocity(self, node: int) -> np.ndarray:
        return self._state(node)[3:]

    def _state(self, node: int) -> np.ndarray:
        poses = [message for _, message in self.said if isinstance(message, Poses)][-1]
        return np.array(poses.states[6 * node - 6 : 6 * node])

    @property
    def modes(self) -> list[tuple[int, str]]:
        return [(r.node, r.mode) for r in self.world.records if isinstance(r, FlightModeChanged)]

    @property
    def collisions(self) -> list[tuple[int, int]]:
        return [(r.node, r.other) for r in self.world.records if isinstance(r, Collided)]


ENGINES = pytest.mark.parametrize("engine", ["kinematic", "pybullet"])


@ENGINES
def test_who_is_asked_nothing_stays_where_it_started(make_scenario: MakeScenario, engine: str) -> None:
    flying = Flying(make_scenario, **{"world.engine": engine})
    flying.fly(5)
    assert flying.at(1) == pytest.approx([-50, 0, 50], abs=0.2)


@ENGINES
def test_a_velocity_is_flown_until_it_is_not_renewed_and_then_the_uav_stops(
    make_scenario: MakeScenario, engine: str
) -> None:
    flying = Flying(make_scenario, **{"world.engine": engine})
    for _ in range(10):
        flying.ask(1, SetpointKind.VELOCITY, v=Enu(0.0, 4.0, 1.0))
        flying.fly(0.5)
    assert flying.velocity(1) == pytest.approx([0, 4, 1], abs=0.3)
    flying.fly(6)
    assert flying.velocity(1) == pytest.approx([0, 0, 0], abs=0.2)
    assert 20 < flying.at(1)[1] < 30, "five seconds of four metres, and one more until it counts as lost"


def test_hold_stops_on_the_spot(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario)
    flying.ask(1, SetpointKind.POSITION, Enu(200.0, 0.0, 50.0), speed_m_s=10.0)
    flying.fly(10)
    place = flying.at(1).copy()
    flying.ask(1, SetpointKind.HOLD)
    flying.fly(10)
    assert flying.at(1) == pytest.approx(place, abs=0.5), "it comes back to where it was told to hold"


@ENGINES
def test_a_uav_takes_off_flies_and_lands_without_a_collision(make_scenario: MakeScenario, engine: str) -> None:
    flying = Flying(make_scenario, **{"world.engine": engine, "nodes.on_ground": True, "world.crash": "falls"})
    flying.fly(3)
    assert flying.at(1)[2] < 0.3, "nobody takes off unasked"
    flying.ask(1, SetpointKind.TAKEOFF, Enu(0.0, 0.0, 30.0), speed_m_s=3.0)
    flying.fly(20)
    assert flying.at(1) == pytest.approx([-50, 0, 30], abs=0.5), "straight up, wherever the setpoint's place is"
    flying.ask(1, SetpointKind.POSITION, Enu(0.0, 60.0, 30.0), speed_m_s=8.0)
    flying.fly(20)
    flying.ask(1, SetpointKind.LAND, speed_m_s=3.0)
    flying.fly(40)
    assert flying.at(1) == pytest.approx([0, 60, 0.1], abs=0.5)
    assert flying.at(2)[2] < 0.3
    assert flying.collisions == []
    assert flying.world.report()["crashed"] == 0


def test_who_lands_stays_over_its_place_although_its_estimate_of_its_velocity_drifts(
    make_scenario: MakeScenario,
) -> None:
    flying = Flying(make_scenario, **{
        "nodes.count": 10, "nodes.altitude_m": 90, "world.navigation": "estimated", "mission.survivors": 1,
        "sensors.gps_common_m": 0, "sensors.gps_bias_m": 0,
    })  # fmt: skip
    flying.fly(2.0)
    before = [flying.at(node) for node in range(1, 11)]
    for _ in range(300):  # as a companion computer asks again and again
        for node in range(1, 11):
            flying.ask(node, SetpointKind.LAND, speed_m_s=1.5)
        flying.fly(0.25)
    off_m = [float(np.linalg.norm((flying.at(node) - was)[:2])) for node, was in enumerate(before, start=1)]
    assert max(flying.at(node)[2] for node in range(1, 11)) < 0.5
    assert max(off_m) < 1.5


def test_who_falls_by_a_fault_senses_it_until_it_hits_the_ground(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario, **{"nodes.altitude_m": 60, "world.crash": "falls", "mission.survivors": 1})
    flying.fly(1.0)
    crash = Mishap("motors", NodeId(1), MishapKind.CRASH, STILL, 0)
    flying.world.receive(NAMES.radio_control, crash, flying.now_ns)
    flying.fly(2.0)
    fixes = [said for topic, said in flying.said if topic == NAMES.sensor(1, "gps") and isinstance(said, Gps)]
    assert fixes[-1].t_ns > 2 * S
    assert fixes[-1].velocity.up < -8.0
    flying.said.clear()
    flying.fly(10.0).said.clear()
    assert not [topic for topic, _ in flying.fly(2.0).said if topic == NAMES.sensor(1, "gps")]


def test_who_is_told_to_land_while_it_takes_off_lands_and_takes_off_again(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario, **{"nodes.on_ground": True, "world.crash": "falls"})
    flying.ask(1, SetpointKind.TAKEOFF, Enu(0.0, 0.0, 30.0), speed_m_s=2.0)
    flying.fly(1.2)
    assert 0.5 < flying.at(1)[2] < 3
    flying.ask(1, SetpointKind.LAND, speed_m_s=2.0)
    flying.fly(15)
    assert flying.at(1)[2] < 0.35
    flying.ask(1, SetpointKind.POSITION, Enu(-50.0, 0.0, 20.0), speed_m_s=5.0)
    flying.fly(15)
    assert flying.at(1) == pytest.approx([-50, 0, 20], abs=0.5)
    assert flying.collisions == []


def test_a_wreck_falls_its_radio_goes_and_it_senses_nothing_more(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario, **{"world.crash": "falls", "nodes.count": 3, "nodes.telemetry_hz": 1})
    for node in (1, 2):
        flying.ask(node, SetpointKind.POSITION, Enu(-50.0, 0.0, 50.0), speed_m_s=10.0)
    flying.fly(30)
    assert flying.collisions == [(2, 1)], "and no second time when they meet the ground"
    assert flying.at(1)[2] == pytest.approx(0, abs=0.3)
    assert flying.at(2)[2] == pytest.approx(0, abs=0.3)
    assert flying.at(3)[2] == pytest.approx(50, abs=0.3)
    cuts = [message for topic, message in flying.said if topic == NAMES.radio_control]
    assert cuts == [Cut("crash-1", 1), Cut("crash-2", 2)]
    late = [topic for topic, message in flying.said if isinstance(message, Gps) and message.t_ns > 25 * S]
    assert set(late) == {NAMES.sensor(3, "gps")}
    flying.ask(1, SetpointKind.TAKEOFF, Enu(0.0, 0.0, 30.0))
    flying.fly(10)
    assert flying.at(1)[2] == pytest.approx(0, abs=0.3), "a wreck does not take off"
    assert flying.modes == [(1, "goto"), (2, "goto"), (1, "fallen"), (2, "fallen")]


def test_a_wreck_that_flew_by_velocities_stays_a_wreck(make_scenario: MakeScenario) -> None:
    """Its velocity ends half a second later, after which a UAV that flies holds its position, as a failsafe."""
    flying = Flying(make_scenario, **{"world.crash": "falls"})
    flying.ask(2, SetpointKind.POSITION, Enu(-50.0, 0.0, 50.0), speed_m_s=10.0)
    for _ in range(150):
        flying.ask(1, SetpointKind.VELOCITY, v=Enu(0.1, 0.0, 0.0))
        flying.fly(0.1)
    flying.fly(10)
    assert flying.modes == [(2, "goto"), (1, "velocity"), (1, "fallen"), (2, "fallen")]


def test_a_world_that_goes_on_knows_its_wrecks(make_scenario: MakeScenario) -> None:
    keys = {"nodes.count": 3, "mobility.model": "onboard", "world.crash": "falls", "world.area_m": 1000}
    at = np.array([[0.0, 0, 0.1], [50, 0, 0.1], [100, 0, 50]])
    landed = Setpoint(0, STILL, 1.0, SetpointKind.LAND)
    world = WorldActor(make_scenario(**keys), "m", flight=SwarmFlight(at, np.zeros((3, 3)), {2: landed}))
    assert world.report()["crashed"] == 1, "the first; the second has landed, the third flies"
    world.start(0)
    takeoff = Setpoint(0, Enu(0.0, 0.0, 30.0), 3.0, SetpointKind.TAKEOFF)
    world.receive(NAMES.setpoint(1), takeoff, 0)
    world.wake(world.next_wake_ns() or 0)
    modes = [(r.node, r.mode) for r in world.records if isinstance(r, FlightModeChanged)]
    assert sorted(modes) == [(1, "fallen"), (2, "land")], "a wreck does not take off"


def test_the_radio_of_a_wreck_may_survive(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario, **{"world.crash": "falls", "world.crash_radio": "survives"})
    flying.ask(2, SetpointKind.POSITION, Enu(-50.0, 0.0, 50.0), speed_m_s=10.0)
    flying.fly(30)
    assert flying.world.report()["crashed"] == 2
    assert not [message for topic, message in flying.said if topic == NAMES.radio_control]


def test_without_crashes_a_contact_is_counted_and_all_fly_on(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario)
    flying.ask(2, SetpointKind.POSITION, Enu(-50.0, 0.0, 50.0), speed_m_s=10.0)
    flying.fly(30)
    assert flying.collisions == [(2, 1)]
    assert flying.at(2)[2] == pytest.approx(50, abs=0.3)


def test_the_swarm_starts_at_its_base(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario, **{"world.base_m": (-900.0, 40.0), "nodes.spacing_m": 10})
    flying.fly(1)
    assert [flying.at(node)[:2].tolist() for node in (1, 2)] == [[-905.0, 40.0], [-895.0, 40.0]]
    flying.ask(1, SetpointKind.POSITION, Enu(-890.0, 0.0, 50.0), speed_m_s=10.0)
    flying.fly(20)
    assert flying.at(1) == pytest.approx([-890, 0, 50], abs=0.5), "the base may lie outside the area"


def test_a_velocity_that_is_no_number_is_counted_and_nobody_moves(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario)
    flying.ask(1, SetpointKind.VELOCITY, v=Enu(float("nan"), 0.0, 0.0))
    flying.fly(2)
    assert flying.world.report()["malformed"] == 1
    assert flying.at(1) == pytest.approx([-50, 0, 50])


def test_the_trace_tells_what_each_flight_controller_does_from_when(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario)
    flying.ask(1, SetpointKind.VELOCITY, v=Enu(0.0, 4.0, 0.0))
    flying.fly(0.5)
    flying.ask(1, SetpointKind.VELOCITY, v=Enu(0.0, 3.0, 0.0))
    flying.ask(2, SetpointKind.POSITION, Enu(100, 0, 50))
    flying.fly(3)
    flying.ask(2, SetpointKind.LAND)
    flying.fly(1)
    assert flying.modes == [(1, "velocity"), (2, "goto"), (1, "failsafe"), (2, "land")]
    assert flying.velocity(1) == pytest.approx([0, 0, 0], abs=0.5), "who is asked nothing any more has stopped"


@ENGINES
def test_nobody_who_flies_at_a_velocity_leaves_the_geofence(make_scenario: MakeScenario, engine: str) -> None:
    flying = Flying(make_scenario, **{"world.engine": engine, "world.area_m": 200})
    farthest = 0.0
    for _ in range(60):
        flying.ask(1, SetpointKind.VELOCITY, v=Enu(-10.0, 8.0, 0.0))
        flying.fly(0.5)
        farthest = max(farthest, *np.abs(flying.at(1)[:2]).tolist())
    assert 140 < farthest < 150.5, "50 m outside of the area"
    assert flying.at(1)[:2] == pytest.approx([-150, 150], abs=3)


RETURN = {"mobility.return_after_s": 5.0, "mobility.return_height_m": 70.0, "world.crash": "falls"}


@pytest.mark.parametrize("engine", ["kinematic", pytest.param("rotors", marks=pytest.mark.slow)])
def test_a_uav_whose_computer_falls_silent_climbs_flies_home_and_lands(
    make_scenario: MakeScenario, engine: str
) -> None:
    flying = Flying(make_scenario, **RETURN, **{"world.engine": engine})
    for _ in range(5):
        flying.ask(1, SetpointKind.POSITION, Enu(60.0, 80.0, 50.0), speed_m_s=10.0)
        flying.fly(4)
    way = []
    for step in range(170):
        flying.ask(2, SetpointKind.VELOCITY)
        flying.fly(0.5)
        place = flying.at(1)
        way.append((float(np.hypot(place[0] + 50, place[1])), float(place[2])))
        assert ((1, "return") in flying.modes) == (step >= 2), "nobody heard of the first for five seconds"
    assert all(up > 67 for off, up in way if 5 < off < 130), "it flies home at a height that is free of obstacles"
    assert flying.at(1) == pytest.approx([-50, 0, 0.1], abs=2.0)
    assert flying.at(2) == pytest.approx([50, 0, 50], abs=0.5), "the other one obeys its computer"
    assert flying.modes == [(1, "goto"), (2, "velocity"), (1, "return")]
    assert flying.collisions == []


@pytest.mark.parametrize(("step_m", "height_m"), [(0.0, 90), (3.0, 94)])
def test_who_flies_above_the_height_of_its_return_does_not_sink_on_its_way(
    make_scenario: MakeScenario, step_m: float, height_m: float
) -> None:
    """The heights of the first of two UAVs are 70, 76, 82, ..., and those of the second one lie between them."""
    flying = Flying(make_scenario, **RETURN, **{"mobility.return_step_m": step_m})
    for _ in range(4):
        flying.ask(1, SetpointKind.POSITION, Enu(-50.0, 100.0, 90.0), speed_m_s=20.0)
        flying.fly(4)
    flying.fly(9)
    assert flying.at(1)[2] == pytest.approx(height_m, abs=1)
    assert 2 < flying.at(1)[1] < 90, "it is on its way"
    assert (1, "return") in flying.modes


def test_a_setpoint_commands_the_return_and_another_one_ends_it(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario, **{"mobility.return_height_m": 70.0})
    flying.ask(1, SetpointKind.POSITION, Enu(-50.0, 100.0, 50.0), speed_m_s=20.0)
    flying.fly(10)
    flying.ask(1, SetpointKind.RETURN, speed_m_s=10.0)
    flying.fly(9)
    assert flying.at(1)[2] == pytest.approx(70, abs=1)
    assert flying.velocity(1)[1] == pytest.approx(-10, abs=0.2), "the speed of the setpoint"
    flying.ask(1, SetpointKind.HOLD)
    flying.fly(5)
    flying.ask(1, SetpointKind.RETURN, speed_m_s=0.0)
    flying.fly(3)
    assert flying.velocity(1)[1] == pytest.approx(-7.5, abs=0.2), "the cruising speed"
    for _ in range(30):  # a computer repeats it, also when the UAV lands and has landed
        flying.ask(1, SetpointKind.RETURN, speed_m_s=0.0)
        flying.fly(2)
    assert flying.at(1) == pytest.approx([-50, 0, 0.1], abs=2.0)
    assert flying.modes == [(1, "goto"), (1, "return"), (1, "hold"), (1, "return")]
    assert flying.collisions == []


def test_who_stands_on_its_pad_ignores_the_command_to_return(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario, **{"nodes.on_ground": True})
    flying.ask(1, SetpointKind.RETURN)
    flying.fly(10)
    assert flying.at(1)[2] < 0.35
    assert flying.modes == []


@pytest.mark.parametrize("engine", ["kinematic", pytest.param("rotors", marks=pytest.mark.slow)])
def test_uavs_whose_computers_fall_silent_at_once_fly_home_across_each_other_without_a_contact(
    make_scenario: MakeScenario, engine: str
) -> None:
    """Nine UAVs are each where the home of the opposite one is, so that all ways home meet in the middle at once."""
    flying = Flying(make_scenario, **RETURN, **{"nodes.count": 9, "world.engine": engine})
    flying.fly(1)
    homes = {node: flying.at(node) for node in range(1, 10)}
    for side, height_m, seconds in ((1, 15.0, 12), (-1, 15.0, 30), (-1, 0.0, 24)):  # up, across, and down again
        for _ in range(seconds // 3):
            for node, home in homes.items():
                place = Enu(side * float(home[0]), side * float(home[1]), 30 + height_m * node)
                flying.ask(node, SetpointKind.POSITION, place, speed_m_s=20.0)
            flying.fly(3)
    assert not flying.collisions
    flying.fly(150)
    assert flying.collisions == []
    returns = [node for node, mode in flying.modes if mode == "return"]
    assert sorted(returns) == list(homes)
    for node, home in homes.items():
        assert flying.at(node) == pytest.approx([home[0], home[1], 0.1], abs=2.0)


def test_a_computer_that_speaks_again_takes_over_from_a_return(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario, **RETURN)
    flying.ask(1, SetpointKind.HOLD)
    flying.fly(12)
    assert flying.modes == [(1, "hold"), (1, "return")], "the other one was never told anything"
    flying.ask(1, SetpointKind.POSITION, Enu(-50.0, 30.0, 40.0), speed_m_s=10.0)
    flying.fly(4.5)
    assert flying.modes[-1] == (1, "goto")
    assert flying.at(1)[1] > 20


def test_who_stands_on_its_pad_or_lands_does_not_return(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario, **RETURN, **{"nodes.on_ground": True})
    flying.ask(2, SetpointKind.TAKEOFF, Enu(0.0, 0.0, 30.0), speed_m_s=3.0)
    flying.fly(3)
    flying.ask(2, SetpointKind.LAND)
    flying.fly(30)
    assert flying.modes == [(2, "takeoff"), (2, "land")]
    assert max(flying.at(1)[2], flying.at(2)[2]) < 0.35


def test_without_the_key_a_silent_computer_leaves_its_uav_where_it_is(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario)
    flying.ask(1, SetpointKind.VELOCITY, v=Enu(0.0, 4.0, 0.0))
    flying.fly(60)
    assert flying.modes == [(1, "velocity"), (1, "failsafe")]


def test_at_a_geofence_of_return_a_uav_flies_home_whatever_it_is_asked_and_obeys_once_it_has_landed(
    make_scenario: MakeScenario,
) -> None:
    keys = {"world.area_m": 200, "mobility.geofence": "return", "mobility.return_height_m": 20.0}
    flying = Flying(make_scenario, **keys, **{"nodes.altitude_m": 20.0})
    farthest = 0.0
    for _ in range(60):
        flying.ask(1, SetpointKind.VELOCITY, v=Enu(-8.0, 0.0, 0.0))
        flying.fly(0.5)
        farthest = max(farthest, -float(flying.at(1)[0]))
    assert 150 < farthest < 165, "50 m outside of the area, and as far as it takes to stop"
    assert flying.modes == [(1, "velocity"), (1, "return")]
    flying.fly(40)
    assert flying.at(1) == pytest.approx([-50, 0, 0.1], abs=2.0)
    assert flying.modes[2:] == []
    flying.ask(1, SetpointKind.TAKEOFF, Enu(0.0, 0.0, 15.0), speed_m_s=3.0)
    flying.fly(10)
    assert flying.at(1)[2] == pytest.approx(15, abs=0.5)
    assert flying.collisions == []


def test_a_flight_controller_lands_when_its_battery_is_nearly_empty_whatever_it_is_asked(
    make_scenario: MakeScenario,
) -> None:
    flying = Flying(
        make_scenario, **{"world.charge": (0.053, 0.053), "sensors.battery_hz": 1, "nodes.altitude_m": 20.0}
    )
    for _ in range(80):
        flying.ask(1, SetpointKind.VELOCITY, v=Enu(0.0, 2.0, 0.0))
        flying.fly(0.5)
    assert (1, "failsafe") in flying.modes
    assert flying.at(1)[2] < 0.5
    assert flying.collisions == [], "it landed, and did not fall"


def test_who_has_landed_is_pushed_by_nobody_that_passes(make_scenario: MakeScenario) -> None:
    flying = Flying(make_scenario, **{"mobility.model": "static", "world.engine": "kinematic", "nodes.altitude_m": 10})
    flying.ask(1, SetpointKind.LAND)
    before = flying.fly(20).world._engine.positions()[0].copy()
    flying.ask(2, SetpointKind.POSITION, Enu(before[0] + 2.0, before[1], 5.0))
    flying.fly(30)
    assert np.array_equal(flying.world._engine.positions()[0], before)
