"""The world, tick by tick: who is told what and when."""

from array import array
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fanet_mw.bus.messages import Battery, Gps, Poses, Setpoint, WifiScan
from fanet_mw.bus.radio_control import Cut, Mishap, MishapKind, Restore
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Collided, FlightModeChanged, Posed
from fanet_mw.units import MS, STILL, Enu, NodeId, S
from sim.world.world import WorldActor

NAMES = Topics("w")
MakeScenario = Callable[..., Scenario]


def world(make_scenario: MakeScenario, **keys: Any) -> WorldActor:
    given = {"nodes.count": 4, "world.engine": "kinematic", "nodes.telemetry_hz": 1, "nodes.spacing_m": 100}
    made = WorldActor(make_scenario(**given | keys), "w")
    made.start(0)
    return made


def advance(made: WorldActor, until_ns: int) -> list[tuple[int, str, Any]]:
    """(instant, topic, message) of what it says, woken just when it asks to be."""
    found = [(0, topic, message) for topic, message in made.outbox]
    made.outbox.clear()
    while (wake_ns := made.next_wake_ns()) is not None and wake_ns <= until_ns:
        made.wake(wake_ns)
        found += [(wake_ns, topic, message) for topic, message in made.outbox]
        made.outbox.clear()
    return found


def steer(made: WorldActor, node: int, place: Enu, *, speed_m_s: float = 8.0, now_ns: int = 0) -> None:
    made.receive(NAMES.setpoint(node), Setpoint(now_ns, place, speed_m_s), now_ns)


def test_fixes_are_as_noisy_as_the_scenario_says(make_scenario: MakeScenario) -> None:
    white = {"sensors.gps_bias_m": 0.0, "sensors.gps_common_m": 0.0, "sensors.gps_vertical": 1.0}
    said = advance(world(make_scenario, **{"world.gps_sigma_m": 3.0, "world.gps_hz": 1, **white}), 200 * S)
    fixes = np.array([message.position for _, topic, message in said if topic == NAMES.sensor(2, "gps")])
    poses = next(message for _, _, message in said if isinstance(message, Poses))
    truth = np.array(poses.states[6:9])
    assert len(fixes) > 190
    assert fixes.std(axis=0) == pytest.approx([3.0, 3.0, 3.0], rel=0.2)
    assert fixes.mean(axis=0) == pytest.approx(truth, abs=1.0)


def test_a_world_that_was_held_up_skips_instants_and_keeps_its_phase(make_scenario: MakeScenario) -> None:
    made = world(make_scenario, **{"mobility.model": "formation", "world.tick_ms": 100})
    advance(made, 1 * S)
    made.wake(2030 * MS)
    assert made.next_wake_ns() == 2000 * MS, "the latest of those that are due"
    advance(made, 2100 * MS)
    assert made.next_wake_ns() == 2200 * MS
    assert made.report()["skipped_ticks"] == 8, "those of 1.2 to 1.9 s"


@pytest.mark.parametrize(
    "setpoint",
    [
        (1, Enu(float("nan"), 0.0, 50.0), 5.0), (1, Enu(0.0, 0.0, 50.0), float("inf")), (9, Enu(0.0, 0.0, 50.0), 5.0),
        (1, Enu(0.0, 0.0, 1e154), 5.0), (1, Enu(0.0, 0.0, 50.0), -1e154),
    ],
)  # fmt: skip
def test_a_setpoint_that_is_none_is_counted_and_nobody_moves(
    make_scenario: MakeScenario, setpoint: tuple[int, Enu, float]
) -> None:
    made = world(make_scenario)
    node, place, speed_m_s = setpoint
    steer(made, node, place, speed_m_s=speed_m_s)
    said = advance(made, 5 * S)
    states = [list(message.states) for _, _, message in said if isinstance(message, Poses)]
    assert made.report()["malformed"] == 1
    assert all(state == states[0] for state in states)


def test_who_flies_into_the_ground_collides_once_and_it_is_counted(make_scenario: MakeScenario) -> None:
    """Two sent to one place, which do not see each other."""
    made = world(make_scenario, **{"mobility.see_m": 0, "nodes.count": 2, "world.navigation": "perfect"})
    for node in (1, 2):
        steer(made, node, Enu(0.0, 0.0, 50.0))
    advance(made, 30 * S)
    assert [(r.node, r.other) for r in made.records if isinstance(r, Collided)] == [(2, 1)]
    assert made.report()["collisions"] == 1


def test_a_swarm_that_stands_has_positions_in_the_trace_from_when_one_of_it_is_sent_away(
    make_scenario: MakeScenario,
) -> None:
    made = world(make_scenario)
    advance(made, 3 * S)
    assert not any(isinstance(record, Posed) for record in made.records), "all are where they were put"
    steer(made, 2, Enu(0.0, 0.0, 50.0), now_ns=3 * S)
    advance(made, 60 * S)
    last = [record for record in made.records if isinstance(record, Posed)][-4:]
    assert [record.node for record in last] == [1, 2, 3, 4]
    assert last[1].t_ns == 60 * S
    assert (last[1].east_m, last[1].north_m) == pytest.approx((0, 0), abs=10), "as far as its receiver tells"


@pytest.mark.parametrize(("share", "left"), [(0.8, 0.3), (0.2, 0.2)])
def test_a_weak_battery_is_no_stronger_than_before(make_scenario: MakeScenario, share: float, left: float) -> None:
    made = world(make_scenario, **{"world.engine": "rotors", "world.charge": [0.3, 0.3], "sensors.battery_hz": 1})
    made.receive(NAMES.radio_control, Mishap("weak", NodeId(2), MishapKind.BATTERY, Enu(share, 0, 0), 0), 0)
    advance(made, 1 * S)
    assert made._drain is not None
    assert made._drain.batteries.charge[1] == pytest.approx(left, abs=0.01)


def test_who_falls_by_a_fault_tells_where_it_is_until_it_hits_the_ground(make_scenario: MakeScenario) -> None:
    made = world(make_scenario, **{"world.gps_hz": 5})
    advance(made, 2 * S)
    made.receive(NAMES.radio_control, Mishap("falls", NodeId(2), MishapKind.CRASH, STILL, 0), 2 * S)
    told_ns = [at_ns for at_ns, topic, _ in advance(made, 12 * S) if topic == NAMES.sensor(2, "gps")]
    assert 4 * S < max(told_ns) < 7 * S, "from 50 m"


def test_scans_of_the_uavs_are_spread_over_the_interval(make_scenario: MakeScenario) -> None:
    keys = {"mission.survivors": 3, "mission.scan_interval_s": 2, "mission.detection_dbm": -300, "world.tick_ms": 100}
    said = advance(world(make_scenario, **keys, **{"mobility.model": "formation"}), 10 * S)
    first = {}
    for at_ns, topic, message in said:
        if isinstance(message, WifiScan) and at_ns:
            first.setdefault(topic, at_ns)
    assert [first[NAMES.sensor(node, "wifi")] for node in (2, 3, 4)] == [500 * MS, 1000 * MS, 1500 * MS]


def test_fixes_come_at_their_rate_whatever_the_ticks_are(make_scenario: MakeScenario) -> None:
    said = advance(
        world(make_scenario, **{"world.gps_hz": 2, "world.tick_ms": 100, "mobility.model": "formation"}), 5 * S
    )
    at_ns = [message.t_ns for _, topic, message in said if topic == NAMES.sensor(1, "gps") and isinstance(message, Gps)]
    assert at_ns == [step * 500 * MS for step in range(11)]


@pytest.mark.parametrize(
    ("keys", "named"),
    [
        (
            {"sensors.inertial_hz": 50},
            r"sensors.inertial_hz = 50 must be <= 10: one reading for each world.tick_ms = 100",
        ),
        ({"world.gps_hz": 20}, r"world.gps_hz = 20 must be <= 10"),
        ({"world.tick_ms": 500, "sensors.radar_hz": 4, "world.gps_hz": 1}, r"sensors.radar_hz = 4 must be <= 2"),
        ({"mission.survivors": 1, "mission.scan_interval_s": 0.05}, r"mission.scan_interval_s = 0.05 must be >= "),
    ],
)
def test_a_rate_that_no_tick_can_keep_is_refused(make_scenario: MakeScenario, keys: dict[str, Any], named: str) -> None:
    with pytest.raises(ConfigError, match=named):
        make_scenario(**keys)


def test_a_receiver_too_slow_to_fly_by_is_refused(make_scenario: MakeScenario) -> None:
    slow = {"mobility.model": "onboard", "world.gps_hz": 0.1}
    with pytest.raises(ConfigError, match=r"world.gps_hz = 0.1 must be >= 0.2: .* lands"):
        make_scenario(**slow)
    make_scenario(**slow, **{"sensors.inertial_hz": 5})
    make_scenario(**slow, **{"world.navigation": "perfect"})


@pytest.mark.parametrize("model", ["static", "formation"])
def test_readings_come_at_their_rate_whether_anything_moves_or_not(make_scenario: MakeScenario, model: str) -> None:
    keys = {"sensors.inertial_hz": 10, "mobility.model": model}
    said = advance(world(make_scenario, **keys), 5 * S)
    assert 50 <= sum(topic == NAMES.sensor(3, "inertial") for _, topic, _ in said) <= 51


def test_poses_name_every_node_and_come_before_anyone_transmits(make_scenario: MakeScenario) -> None:
    (poses, *_) = [message for _, _, message in advance(world(make_scenario), 0) if isinstance(message, Poses)]
    assert poses.ids == array("H", [1, 2, 3, 4])
    assert poses.t_ns == 0


def said_to_be_cut(found: list[tuple[int, str, Any]]) -> list[tuple[float, str]]:
    return [(t_ns / S, message.label) for t_ns, _, message in found if isinstance(message, Cut)]


def test_the_radio_of_a_uav_that_crashes_on_the_ground_dies_at_once(make_scenario: MakeScenario) -> None:
    made = world(make_scenario, **{"nodes.on_ground": True})
    steer(made, 1, Enu(0.0, 0.0, 20.0))
    advance(made, 2 * S)
    made.receive(NAMES.radio_control, Mishap("node-2", NodeId(2), MishapKind.CRASH, STILL), 2 * S)
    assert said_to_be_cut(advance(made, 6 * S)) == [(2.1, "crash-2")]


def test_a_uav_that_crashes_among_others_that_all_stand_is_known_to_have_fallen(make_scenario: MakeScenario) -> None:
    made = world(make_scenario, **{"nodes.on_ground": True})
    made.receive(NAMES.radio_control, Mishap("node-2", NodeId(2), MishapKind.CRASH, STILL), 0)
    assert [label for _, label in said_to_be_cut(advance(made, 2 * S))] == ["crash-2"]
    assert [(one.node, one.mode) for one in made.records if isinstance(one, FlightModeChanged)] == [(2, "fallen")]


def test_the_end_of_all_faults_gives_nobody_back_a_radio_that_died(make_scenario: MakeScenario) -> None:
    made = world(make_scenario, **{"nodes.altitude_m": 5})
    made.receive(NAMES.radio_control, Mishap("node-2", NodeId(2), MishapKind.CRASH, STILL), 0)
    assert [label for _, label in said_to_be_cut(advance(made, 4 * S))] == ["crash-2"]
    for label, again in (("", ["crash-2"]), ("jam", []), ("crash-2", ["crash-2"]), ("", ["crash-2"])):
        made.receive(NAMES.radio_control, Restore(label), 4 * S)
        assert [message.label for _, message in made.outbox if isinstance(message, Cut)] == again
        made.outbox.clear()


def test_a_uav_whose_battery_has_lost_all_falls(make_scenario: MakeScenario) -> None:
    made = world(make_scenario, **{"sensors.battery_hz": 1, "nodes.altitude_m": 20})
    steer(made, 1, Enu(0.0, 0.0, 30.0))
    advance(made, 2 * S)
    made.receive(NAMES.radio_control, Mishap("node-2", NodeId(2), MishapKind.BATTERY, Enu(0.0, 0.0, 0.0)), 2 * S)
    assert said_to_be_cut(advance(made, 6 * S)) == [(2.1, "crash-2")]
    assert [one.mode for one in made.records if isinstance(one, FlightModeChanged) and one.node == 2] == ["fallen"]


@pytest.mark.parametrize("engine", ["kinematic", "rotors"])
def test_a_swarm_that_hovers_where_it_was_put_drains_its_batteries_and_falls_without_charge(
    make_scenario: MakeScenario, engine: str
) -> None:
    made = world(make_scenario, **{"world.engine": engine, "sensors.battery_hz": 1, "nodes.altitude_m": 20})
    told = [message for _, _, message in advance(made, 10 * S) if isinstance(message, Battery)]
    assert told[-1].current_a > 10
    assert told[-1].charge < 0.995
    made.receive(NAMES.radio_control, Mishap("node-2", NodeId(2), MishapKind.BATTERY, Enu(0.0, 0.0, 0.0)), 10 * S)
    assert [label for _, label in said_to_be_cut(advance(made, 16 * S))] == ["crash-2"]
    assert made._engine.positions()[1][2] < 1.0
    assert made._engine.positions()[0] == pytest.approx([-50.0, -50.0, 20.0], abs=1.0)
