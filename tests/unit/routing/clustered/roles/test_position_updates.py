"""When a node sends a position update: range 250 m, so 25 m off; at least 5 s apart; after 20 s at the latest."""

import pytest
from kit import MakeScenario

from fanet_mw.motion import Motion
from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.roles.joining import Joining
from fanet_mw.routing.clustered.roles.position_updates import PositionUpdates, lost_ns, settled_ns
from fanet_mw.units import MS, Enu, NodeId, S

HERE, STILL = Enu(0.0, 0.0, 50.0), Enu(0.0, 0.0, 0.0)


def told(velocity: Enu = STILL) -> PositionUpdates:
    found = PositionUpdates(range_m=250.0)
    found.on_update(Motion(HERE, velocity, 0))
    return found


def test_who_flies_on_straight_as_it_told_need_not_tell() -> None:
    known = told(Enu(10.0, 0.0, 0.0))
    assert not known.outdated(Enu(100.0, 0.0, 50.0), now_ns=10 * S)
    assert known.outdated(HERE, now_ns=10 * S), "who has stopped must"


@pytest.mark.parametrize(("east_m", "tells"), [(24.9, False), (25.1, True)])
def test_who_is_a_tenth_of_the_range_off_tells(east_m: float, tells: bool) -> None:
    assert told().outdated(Enu(east_m, 0.0, 50.0), now_ns=10 * S) == tells


@pytest.mark.parametrize("count", [5, 45, 200])
def test_an_idle_node_has_told_twice_before_it_is_forgotten_however_large_the_swarm(
    make_scenario: MakeScenario, count: int
) -> None:
    """Its hellos are as rare, and its joins as late, as they can be; the first of the two may be lost."""
    scenario = make_scenario(**{"nodes.count": count})
    port = Node(NodeId(2), scenario, make_protocol, position=HERE).port
    joining = Joining(port, PositionUpdates(range_m=250.0), None, lambda: 0.999)
    joining.join(instead_of=0, again=False, now_ns=0)
    told = []
    for hello in range(1, 400):
        hello_ns = hello * 1100 * MS
        if joining.due_ns is not None and joining.due_ns <= hello_ns:
            told.append(joining.due_ns)
            joining.join(instead_of=0, again=False, now_ns=joining.due_ns)
        joining.update_if_outdated(listed=count, now_ns=hello_ns)
    assert told[1] + scenario.clusters.period_ns < lost_ns(scenario) < told[2]


@pytest.mark.parametrize("count", [5, 45, 200])
@pytest.mark.parametrize("speed_m_s", [0, 2, 7.5, 20])
def test_after_a_turn_all_have_told_before_the_swarm_counts_as_settled(
    make_scenario: MakeScenario, count: int, speed_m_s: float
) -> None:
    """Whoever has told just before the turn tells again 5 s later at the earliest; its hello is as late as can be."""
    scenario = make_scenario(**{"nodes.count": count, "mobility.speed_m_s": speed_m_s})
    speed_m_s = max(speed_m_s, 1.0)
    port = Node(NodeId(2), scenario, make_protocol, position=HERE).port
    updates = PositionUpdates(range_m=scenario.radio.range_m)
    joining = Joining(port, updates, None, lambda: 0.999)
    updates.on_update(Motion(HERE, Enu(speed_m_s, 0, 0), 0))
    strays_ns = round(0.1 * scenario.radio.range_m / speed_m_s * S)
    hello_ns = max(5 * S, strays_ns) - 1
    while joining.due_ns is None:
        joining.update_if_outdated(listed=count, now_ns=hello_ns)
        hello_ns += round(1.1 * scenario.routing.hello_interval_s * S)
    told_ns = joining.due_ns + scenario.clusters.period_ns
    assert told_ns <= settled_ns(scenario) <= told_ns + min(5 * S, strays_ns) + 2 * S


def test_two_tellings_are_some_seconds_apart() -> None:
    known = told()
    assert not known.outdated(Enu(1000.0, 0.0, 50.0), now_ns=5 * S - 1)
    assert not known.may_update(5 * S - 1)
    assert known.outdated(Enu(1000.0, 0.0, 50.0), now_ns=5 * S)


def test_who_has_flooded_nothing_for_long_tells_that_it_lives() -> None:
    known = told()
    assert not known.outdated(HERE, now_ns=20 * S)
    assert known.outdated(HERE, now_ns=20 * S + 1)
    known.on_flooding(15 * S)
    assert not known.outdated(HERE, now_ns=35 * S)


def test_who_has_never_told_does_not_begin_here() -> None:
    assert not PositionUpdates(range_m=250.0).outdated(HERE, now_ns=100 * S)
