"""A world that starts again goes on where the swarm was, whatever else was heard on the bus."""

from array import array
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from kit import slow

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import Battery, Message, Poses, Setpoint, SetpointKind
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import OnSample
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, S
from sim.world.flight_recorder import FlightRecorder, SwarmFlight
from sim.world.world import WorldActor

NAMES = Topics("flight")
TICK_NS = 100 * MS


class Ear:
    """Stands for the bus."""

    def __init__(self, scenario: Scenario) -> None:
        self._hears: dict[str, OnSample] = {}
        self.recorder = FlightRecorder(scenario, self._hears.__setitem__, NAMES)

    def say(self, topic: str, *messages: Message) -> None:
        self.say_bytes(topic, codecs.encode(messages))

    def say_bytes(self, topic: str, payload: bytes) -> None:
        expression = NAMES.sensor("*", "battery") if topic.endswith("/battery") else NAMES.all_setpoints
        self._hears[NAMES.pose if topic == NAMES.pose else expression](topic, payload)


@pytest.fixture(params=["kinematic", *slow("pybullet")])
def scenario(request: pytest.FixtureRequest, make_scenario: Any) -> Scenario:
    scenario: Scenario = make_scenario(
        **{"nodes.count": 4, "nodes.spacing_m": 30, "mobility.model": "formation", "mobility.speed_m_s": 8,
           "world.engine": request.param, "world.tick_ms": 100, "duration_s": 60,
           "world.navigation": "perfect"}
    )  # fmt: skip
    return scenario


def fly(world: WorldActor, ear: Ear, *, from_ns: int, until_ns: int) -> list[np.ndarray]:
    """Let a world run; returns the positions of every tick."""
    flown = []
    world.start(from_ns)
    now_ns = from_ns
    while now_ns <= until_ns:
        for topic, message in world.outbox:
            if isinstance(message, Poses):
                ear.say(topic, message)
                flown.append(np.array(message.states).reshape(-1, 6)[:, :3])
        world.outbox.clear()
        wake_ns = world.next_wake_ns()
        assert wake_ns is not None
        now_ns = wake_ns
        world.wake(now_ns)
    return flown


def test_a_world_that_starts_again_goes_on_where_it_was_and_to_where_its_uavs_were_sent(scenario: Scenario) -> None:
    ear, sent = Ear(scenario), Setpoint(10 * S, Enu(-60.0, 90.0, 55.0), 6.0)
    first = WorldActor(scenario, "flight")
    first.receive(NAMES.setpoint(3), sent, 0)
    ear.say(NAMES.setpoint(3), sent)
    before = fly(first, ear, from_ns=0, until_ns=20 * S)
    assert np.linalg.norm(before[-1] - before[0], axis=1).min() > 50, "far from where they started"

    second = WorldActor(scenario, "flight", flight=ear.recorder.last())
    after = fly(second, ear, from_ns=22 * S, until_ns=60 * S)
    assert np.linalg.norm(after[0] - before[-1], axis=1).max() < 1
    steps = [np.linalg.norm(b - a, axis=1).max() for a, b in pairwise(after)]
    assert max(steps) < 20 * TICK_NS / S, "nobody jumps; 14 m/s is the most that is flown to catch up"
    untouched = fly(WorldActor(scenario, "flight"), Ear(scenario), from_ns=0, until_ns=60 * S)
    assert np.linalg.norm(after[-1][:2] - untouched[-1][:2], axis=1).max() < 3, "back on the formation's track"
    assert np.linalg.norm(after[-1][2] - np.array(sent.position)) < 3, "where it was sent before the world ended"


def good(count: int = 4) -> Poses:
    return Poses(S, array("H", range(1, count + 1)), array("d", [1.0] * 6 * count))


SPOILT: dict[str, Callable[[Ear], None]] = {
    "nothing heard": lambda ear: None,
    "garbage": lambda ear: ear.say_bytes(NAMES.pose, b"\xff\x00 garbage"),
    "another swarm's": lambda ear: ear.say(NAMES.pose, good(3)),
    "not a number": lambda ear: ear.say(NAMES.pose, good()._replace(states=array("d", [float("nan")] * 24))),
    "beyond the world": lambda ear: ear.say(NAMES.pose, good()._replace(states=array("d", [1e300] * 24))),
    "one too many": lambda ear: ear.say(NAMES.pose, good(5)),
}  # fmt: skip


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=SPOILT.keys())
def test_poses_that_are_not_the_swarms_are_not_gone_on_from(make_scenario: Any, spoil: Callable[[Ear], None]) -> None:
    ear = Ear(make_scenario(**{"nodes.count": 4}))
    spoil(ear)
    assert ear.recorder.last() is None


def test_setpoints_that_make_no_sense_are_left_out(make_scenario: Any) -> None:
    ear = Ear(make_scenario(**{"nodes.count": 4}))
    ear.say(NAMES.pose, good())
    ear.say(NAMES.setpoint(2), Setpoint(0, Enu(1, 2, 3), 4.0))
    ear.say(NAMES.setpoint(3), Setpoint(0, Enu(1, float("inf"), 3), 4.0))
    ear.say(NAMES.setpoint(1), Setpoint(0, Enu(1, 2, 3), 4.0, SetpointKind.VELOCITY, Enu(0, 0, 1e154)))
    ear.say(NAMES.setpoint(77), Setpoint(0, Enu(1, 2, 3), 4.0))
    ear.say_bytes(NAMES.setpoint(4), b"garbage")
    flight = ear.recorder.last()
    assert isinstance(flight, SwarmFlight)
    assert list(flight.setpoints) == [2]


def test_batteries_are_no_fuller_in_a_world_that_starts_again(make_scenario: Any) -> None:
    scenario = make_scenario(**{"nodes.count": 4, "sensors.battery_hz": 1})
    ear = Ear(scenario)
    ear.say(NAMES.pose, good())
    for node, charge in ((1, 0.9), (2, 0.3), (2, 0.25), (3, float("nan")), (4, 2.0)):
        ear.say(NAMES.sensor(node, "battery"), Battery(0, 11.0, 5.0, charge))
    world = WorldActor(scenario, "flight", flight=ear.recorder.last())
    world.start(10 * S)
    while (wake_ns := world.next_wake_ns()) is not None and wake_ns <= 11 * S:
        world.wake(wake_ns)
    told = {topic: message.charge for topic, message in world.outbox if isinstance(message, Battery)}
    charges = [told[NAMES.sensor(node, "battery")] for node in (1, 2, 3, 4)]
    assert charges == pytest.approx([0.9, 0.25, 1.0, 1.0], abs=0.01)
