"""Who keeps a timetable: only those that have shown it by a flood in their turn, not long ago."""

from fanet_mw.routing.clustered.roles.leader_election import Authority
from fanet_mw.routing.clustered.roles.membership import Version
from fanet_mw.routing.clustered.timetable.followers import Followers
from fanet_mw.units import NodeId, S

LEADER, OTHER, US = (NodeId(n) for n in (1, 2, 3))
NODES = [LEADER, OTHER, US]
NOW, NEXT = (Version(Authority(1, LEADER), epoch) for epoch in (7, 8))


def have(followers: Followers, version: Version = NOW, *, now_s: int = 0) -> bool:
    return followers.have(version, NODES, silent_ns=5 * S, now_ns=now_s * S)


def all_heard() -> Followers:
    followers = Followers(US)
    followers.follow(NOW)
    for node in (LEADER, OTHER):
        followers.hear(NOW, node, now_ns=0)
    return followers


def test_all_are_known_when_each_has_flooded_in_its_turn() -> None:
    followers = Followers(US)
    followers.follow(NOW)
    followers.hear(NOW, LEADER, now_ns=0)
    assert not have(followers)
    followers.hear(NOW, OTHER, now_ns=0)
    assert have(followers)
    assert not have(followers, NEXT)


def test_what_is_heard_before_the_node_has_the_timetable_counts_for_nothing() -> None:
    followers = Followers(US)
    for node in NODES:
        followers.hear(NEXT, node, now_ns=0)
    followers.follow(NEXT)
    assert not have(followers, NEXT)


def test_a_node_that_falls_silent_is_no_longer_counted_and_counts_again_when_it_is_heard() -> None:
    followers = all_heard()
    assert have(followers, now_s=5)
    assert not have(followers, now_s=6)
    followers.hear(NOW, OTHER, now_ns=6 * S)
    assert have(followers, now_s=6)


def test_a_node_that_others_call_silent_promises_nothing_for_a_while_or_until_the_next_timetable() -> None:
    followers = all_heard()
    followers.doubt(US, now_ns=1 * S)
    assert not have(followers, now_s=2)
    for node in (LEADER, OTHER):
        followers.hear(NOW, node, now_ns=16 * S)
    assert have(followers, now_s=16)
    followers.doubt(US, now_ns=17 * S)
    followers.follow(NEXT)
    for node in (LEADER, OTHER):
        followers.hear(NEXT, node, now_ns=18 * S)
    assert have(followers, NEXT, now_s=18)


def test_a_node_that_others_call_silent_has_to_show_again_that_it_keeps_the_timetable() -> None:
    followers = all_heard()
    followers.doubt(OTHER, now_ns=1 * S)
    assert not have(followers, now_s=1)
    followers.hear(NOW, OTHER, now_ns=2 * S)
    assert have(followers, now_s=2)
