"""What an observer knows of a swarm, fed by hand."""

from array import array

import pytest
from kit import MakeScenario

from fanet_mw.bus.link_stats import COUNTS, LinkStats
from fanet_mw.bus.messages import Poses
from fanet_mw.mavlink import BatteryState, Encoder
from fanet_mw.trace import BoundStated, Delivered, Dropped, Generated, Record
from fanet_mw.units import MS, NodeId, S
from sim.observation.swarm_state import SwarmState
from sim.observation.turns import turns


def pose(state: SwarmState, t_ns: int, *, east_m_s: float = 0.0) -> None:
    state.take_poses(Poses(t_ns, array("H", [1]), array("d", [0.0, 0.0, 50.0, east_m_s, 0.0, 0.0])))


def sent(t_ns: int, app: str, *nodes: int, bound_ns: int = 0) -> list[Record]:
    """A packet of node 1 that comes to these nodes after 10 ms."""
    stated = [BoundStated(t_ns, 1, 7, bound_ns)] if bound_ns else []
    return [Generated(t_ns, 1, 7, app, 100), *stated, *(Delivered(t_ns, node, 1, 7, 10 * MS, 1) for node in nodes)]


def test_a_uav_accelerates_between_two_poses_whatever_is_told_in_between(make_scenario: MakeScenario) -> None:
    state = SwarmState(make_scenario())
    pose(state, 1 * S)
    state.take_records([Dropped(1 * S + 99 * MS, 1, "duplicate", 1, 7)])
    pose(state, 1 * S + 100 * MS, east_m_s=0.2)
    assert state.uavs[1].acceleration.east == pytest.approx(2.0)


def test_copies_count_at_the_targets_alone(make_scenario: MakeScenario) -> None:
    state = SwarmState(make_scenario(**{"nodes.count": 4, "traffic.targets": [4]}))
    state.take_records(sent(S, "traffic", 2, 3, bound_ns=50 * MS))
    pose(state, 2 * S + state.settling_ns)
    assert state.metrics()["delivered_share"] == 0.0
    assert state.metrics()["delay_max_ms"] is None
    pose(state, 60 * S)
    assert state.metrics()["bounds_broken"] == 1, "never came to node 4"


def test_a_report_is_for_the_post_too(make_scenario: MakeScenario) -> None:
    state = SwarmState(make_scenario(**{"nodes.count": 2, "ground.at_m": [0, 0]}))
    state.take_records(sent(S, "report", 2, bound_ns=50 * MS))
    pose(state, 60 * S)
    assert state.metrics()["bounds_broken"] == 1


def test_a_bound_of_a_users_packet_breaks_where_it_comes_late(make_scenario: MakeScenario) -> None:
    """The trace does not tell for whom it is meant."""
    state = SwarmState(make_scenario(**{"nodes.count": 9}))
    state.take_records(sent(S, "mine", 2, 3, bound_ns=5 * MS))
    state.take_records([Generated(S, 2, 1, "mine", 9), BoundStated(S, 2, 1, S), Delivered(S, 3, 2, 1, 10 * MS, 1)])
    pose(state, 60 * S)
    assert state.metrics()["bounds_broken"] == 2


def test_links_are_forgotten_when_nobody_transmits_any_more(make_scenario: MakeScenario) -> None:
    state = SwarmState(make_scenario())
    pose(state, 1 * S)
    state.take_links(LinkStats(1 * S, S, array("H", [1, 2]), array("I", [1] * COUNTS), array("q", [0])))
    pose(state, 4 * S)
    assert [row[:2] for row in state.link_rows()] == [(1, 2)]
    pose(state, 6 * S)
    assert not list(state.link_rows())


def test_an_empty_battery_is_shown_as_empty(make_scenario: MakeScenario) -> None:
    """MAVLink 2 cuts off zeros at the end of a message, among them a charge of 0 %."""
    state = SwarmState(make_scenario())
    pose(state, 1 * S)
    shown = []
    for charge in (50, 0, None):
        battery = None if charge is None else BatteryState(12.0, 1.0, 0, charge)
        state.take_tap(1, S, Encoder(NodeId(1), component=1).sys_status(battery))
        shown.append(state.uavs[1].charge_percent)
    assert shown == [50, 0, None]


def test_turns_of_an_older_timetable_are_nobodys(make_scenario: MakeScenario) -> None:
    frame = {"start_ms": 1000.0, "period_ms": 400.0, "turn_ms": 50.0, "contention_ms": 100.0}
    newer = {**frame, "start_ms": 1800.0, "period_ms": 600.0}
    reports = {1: {"turns": {**frame, "own": [0]}}, 2: {"turns": {**newer, "own": [0]}}}
    found = turns(make_scenario(**{"nodes.count": 3}), reports)
    assert found is not None
    assert found.owners(1800 * MS + 120 * MS) == [2], "node 1 has heard nothing since"
    assert {one.node for one in found.own} == {2}
