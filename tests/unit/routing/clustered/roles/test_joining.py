"""When a node tells the leader how well it hears its neighbors: as soon as it knows, and again until that is heeded."""

import random
from collections.abc import Callable

import pytest

from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.links.link_quality import LinkQuality
from fanet_mw.routing.clustered.roles.joining import Joining
from fanet_mw.routing.clustered.roles.position_updates import PositionUpdates
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, NodeId, S

US, NEIGHBOR = NodeId(2), NodeId(3)


@pytest.fixture
def joining(make_scenario: Callable[..., Scenario]) -> Joining:
    """A node that hears a hello a second of its neighbor, and has joined twice, the last time after 7.5 s."""
    node = Node(US, make_scenario(**{"nodes.count": 5}), make_protocol, position=Enu(0.0, 0.0, 50.0))
    links = LinkQuality(US, hello_ns=1 * S)
    links.start(0)
    for second in range(40):
        links.on_hello(NEIGHBOR, rssi_dbm=-60.0, now_ns=second * S)
    made = Joining(node.port, PositionUpdates(range_m=250.0), links, random.Random(1).random)
    for joined_ns in (1 * S, 7500 * MS):
        made.join(instead_of=0, again=True, now_ns=joined_ns)
    made.rest()
    return made


def told_s(joining: Joining, *, from_s: int, to_s: int) -> list[int]:
    """The seconds in which the node wants to tell its links, and does so with its hello."""
    found = []
    for second in range(from_s, to_s):
        joining.update_if_outdated(listed=0, now_ns=second * S)
        if joining.due_ns is not None:
            assert joining.due_ns < second * S + 100 * MS, "spread a little"
            joining.join(instead_of=0, again=False, now_ns=second * S)
            found.append(second)
    return found


def test_links_are_told_as_soon_as_there_is_an_estimate_however_late_the_node_joined(joining: Joining) -> None:
    assert told_s(joining, from_s=7, to_s=13) == [8]


def test_links_are_told_again_until_the_leader_announces_links(joining: Joining) -> None:
    """A join is a flood over links that lose frames; without the links of most nodes there is no timetable."""
    assert told_s(joining, from_s=7, to_s=20) == [8, 13, 18]
    joining.on_links_announced()
    assert told_s(joining, from_s=20, to_s=35) == []


def test_another_leader_has_to_hear_of_the_links_too(joining: Joining) -> None:
    joining.on_links_announced()
    assert told_s(joining, from_s=7, to_s=15) == [8]
    joining.ask_for_a_place(15 * S)
    joining.join(instead_of=0, again=False, now_ns=16 * S)
    assert told_s(joining, from_s=17, to_s=25) == [21]
