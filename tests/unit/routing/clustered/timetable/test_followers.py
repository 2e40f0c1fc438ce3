"""Who keeps a timetable: only those that have shown it by a flood in their turn."""

from fanet_mw.routing.clustered.roles.leader_election import Authority
from fanet_mw.routing.clustered.roles.membership import Version
from fanet_mw.routing.clustered.timetable.followers import Followers
from fanet_mw.units import NodeId

NOW, NEXT = (Version(Authority(1, NodeId(1)), epoch) for epoch in (7, 8))
NODES = [NodeId(n) for n in (1, 2, 3)]


def test_all_are_known_when_each_has_flooded_in_its_turn() -> None:
    followers = Followers(NodeId(1))
    followers.follow(NOW)
    followers.hear(NOW, NodeId(2))
    assert not followers.have(NOW, NODES)
    followers.hear(NOW, NodeId(3))
    assert followers.have(NOW, NODES)
    assert not followers.have(NEXT, NODES)


def test_what_is_heard_before_the_node_has_the_timetable_counts_for_nothing() -> None:
    followers = Followers(NodeId(1))
    for node in NODES:
        followers.hear(NEXT, node)
    followers.follow(NEXT)
    assert not followers.have(NEXT, NODES)
