"""Time beacons over hops, by timelines: two steps, election, a reference that comes back, and neighbors that lie."""

import pytest

from fanet_mw.scenario import Clock
from fanet_mw.timesync.clock_fit import Oscillator
from fanet_mw.timesync.ftsp import Settings, TimeSync
from fanet_mw.units import MS, US, NodeId, S
from fanet_mw.wire.hello.beacon import TimeBeacon
from tests.property.time_network import Network, line

LIMIT_NS = 5 * S
CRYSTAL = Clock(sync="beacons", offset_ms=500, drift_ppm=20)


def follower(node: int = 2, *, leads: bool = False) -> TimeSync:
    sync = TimeSync(Settings(NodeId(node), leads, S, Oscillator(40e-6, 0.0, US), 834, LIMIT_NS, NodeId(1)))
    sync.start(0)
    return sync


def said(t_ns: int, hello: int, *, node: int = 1, reference: int = 1, hops: int = 0, error_ns: int = 0) -> TimeBeacon:
    return TimeBeacon(t_ns, error_ns, 0, 0, hello, hello, node, reference, 0, hops)


def hear(sync: TimeSync, src: int, hello: int, ended_ns: int, beacon: TimeBeacon | None) -> None:
    sync.on_hello(NodeId(src), hello, beacon, ended_ns=ended_ns, local_ns=ended_ns)


def follow(sync: TimeSync, *, ahead_ns: int, hellos: int, src: int = 1, first: int = 1, **keys: int) -> None:
    """`src` says hello once a second; its swarm time is ahead of our clock by this much."""
    for hello in range(first, first + hellos):
        earlier_ns = (hello - 1) * S
        beacon = said(earlier_ns + ahead_ns, hello - 1, node=src, **keys) if hello > first else None
        hear(sync, src, hello, hello * S, beacon)


def test_a_hello_alone_tells_no_time_and_the_next_one_tells_that_of_the_first() -> None:
    sync = follower()
    hear(sync, 1, 7, 3 * S, None)
    assert not sync.synced
    hear(sync, 1, 8, 4 * S, said(3 * S + 25 * MS, 7))
    assert sync.synced
    assert abs(sync.line.swarm_ns(4 * S) - (4 * S + 25 * MS)) < US
    assert (sync.reference, sync.hops(4 * S)) == (1, 1)


def test_a_time_is_supported_until_three_hellos_after_the_reference_or_two_others_stated_it() -> None:
    sync = follower()
    assert not sync.supported(0)
    follow(sync, ahead_ns=25 * MS, hellos=5)
    assert sync.supported(8 * S)
    assert not sync.supported(8 * S + 1)
    for src, enough in ((3, False), (4, True)):
        follow(sync, ahead_ns=25 * MS, hellos=2, src=src, first=8, hops=1)
        assert sync.supported(9 * S) == enough


def test_a_pair_holds_half_the_flight_and_its_hop_s_error() -> None:
    """Up to 20 us of flight: 10 us are taken for granted, 10 us and a stamp are stated as error."""
    sync = TimeSync(Settings(NodeId(2), False, S, Oscillator(40e-6, 0.0, US), 20 * US, LIMIT_NS, NodeId(1)))  # noqa: FBT003
    sync.start(0)
    hear(sync, 1, 7, 3 * S, None)
    hear(sync, 1, 8, 4 * S, said(3 * S + 25 * MS, 7, error_ns=5 * US))
    assert sync.line.swarm_ns(3 * S) == 3 * S + 25 * MS + 10 * US
    assert sync.line.stated_ns == 5 * US + 10 * US + US


def test_however_long_contention_defers_a_hello_the_time_is_exact() -> None:
    """The beacon names when the first hello ended; when the second was made or ended does not matter."""
    found = []
    for deferred_ns in (0, 300 * MS):
        sync = follower()
        hear(sync, 1, 1, S + deferred_ns, None)
        hear(sync, 1, 2, 2 * S + 7 * deferred_ns // 10, said(S + deferred_ns + 25 * MS, 1))
        found.append(sync.line.offset_at(2 * S))
    assert found[0] == found[1]


def test_a_beacon_about_a_hello_that_was_lost_says_nothing() -> None:
    sync = follower()
    hear(sync, 1, 2, 2 * S, said(S, 1))
    assert not sync.synced


def test_the_leader_listens_and_then_takes_its_own_clock() -> None:
    leader = follower(1, leads=True)
    leader.hello_sent(1, ended_ns=2 * S)
    assert leader.beacon(2 * S) is None
    beacon = leader.beacon(3 * S)
    assert beacon is not None
    assert (beacon.t_ns, beacon.hello, beacon.hops, beacon.error_ns) == (2 * S, 1, 0, 0)


def test_without_a_leader_the_lowest_id_becomes_the_reference() -> None:
    links = {node: [n for n in neighbors if n != 1] for node, neighbors in line(5).items() if node != 1}
    network = Network(links, CRYSTAL, seed=3)
    network.run(45)
    assert {member.sync.reference for member in network.members.values()} == {2}
    assert network.worst_us(reference=2) < 20


def test_whoever_becomes_the_reference_is_right_by_definition_for_ever() -> None:
    sync, oscillator = follower(), Oscillator(40e-6, 0.0, US)
    follow(sync, ahead_ns=25 * MS, hellos=8, error_ns=5 * US)
    assert sync.line.error_ns(8 * S, oscillator) >= 5 * US
    sync.pass_time(200 * S)
    assert sync.is_reference
    for second in (200, 201, 900):
        assert sync.line.error_ns(second * S, oscillator) == 0
    assert sync.line.rate_error(oscillator) == 0
    assert sync.hops(201 * S) == 0


def test_in_a_long_chain_nobody_takes_its_own_time_before_the_leader_s_has_come() -> None:
    """Two times would meet in the middle of the chain, and one of them would have to step."""
    network = Network(line(16), CRYSTAL, seed=4)
    network.run(60)
    assert [node for node, member in network.members.items() if member.sync.counts["claimed"]] == [1]
    assert all(member.sync.reference == 1 for member in network.members.values())


def test_when_the_reference_dies_another_carries_its_time_on_without_a_step() -> None:
    network = Network(line(6), CRYSTAL, seed=5)
    network.run(40)
    steps = {node: member.sync.counts["step"] for node, member in network.members.items()}
    network.members[1].alive = False
    network.run(90)
    assert {m.sync.reference for m in network.members.values() if m.alive} == {2}
    assert {node: member.sync.counts["step"] for node, member in network.members.items()} == steps
    assert network.worst_us(reference=2) < 20
    drifted_us = abs(network.members[2].swarm_ns(90 * S) - network.members[1].swarm_ns(90 * S)) / US
    assert drifted_us < 50, "the swarm's time is still that of node 1, as well as its rate was known"


def test_a_reference_that_restarts_learns_the_time_and_leads_on() -> None:
    network = Network(line(4), CRYSTAL, seed=6)
    network.run(40)
    before_ns = network.members[2].swarm_ns(40 * S) - 40 * S
    again = network.members[1]
    fresh = Network({1: [2]}, Clock(sync="beacons", offset_ms=900, drift_ppm=20), seed=77).members[1]
    fresh.hello = again.hello
    network.members[1] = fresh
    fresh.sync.start(fresh.clock.local_ns(40 * S))
    network.run(75)
    assert fresh.sync.is_reference
    assert abs(network.members[2].swarm_ns(75 * S) - 75 * S - before_ns) < 2 * MS, "not the restarted clock's second"
    assert network.worst_us() < 30


def test_a_reference_whose_clock_has_jumped_goes_on_at_its_rate() -> None:
    """Two statements that are 40 ms apart and 8 us wrong tell where swarm time is, but not how fast it goes: it goes as
    fast as this clock, for the swarm follows it.
    """
    leader = follower(1, leads=True)
    neighbors = (2, 3, 4)
    ahead_ns = 0
    for second in range(3, 30):
        leader.pass_time(second * S - ahead_ns)
        ahead_ns = 0 if second < 12 else 3 * S
        for node in neighbors:
            noise_ns = (4 - 2 * (node % 3)) * US
            earlier_ns = (second - 1) * S + node * 20 * MS
            beacon = said(earlier_ns + noise_ns, second - 1, node=node, hops=1, error_ns=8 * US)
            hear(leader, node, second, second * S + node * 20 * MS - ahead_ns, beacon)
    leader.pass_time(30 * S - ahead_ns)
    assert leader.counts["lost"] == 1
    assert leader.is_reference
    assert leader.line.rate == 0
    assert abs(leader.line.swarm_ns(40 * S - ahead_ns) - 40 * S) < 10 * US


@pytest.mark.parametrize("back_s", [2, 4, 20])
def test_a_clock_that_jumps_back_is_noticed_as_soon_as_one_that_jumps_ahead(back_s: int) -> None:
    """What neighbors state after the jump seemed to come too soon after what they had stated before it, for as long as
    the clock took to be where it was.
    """
    sync = follower()
    for second in range(3, 36):
        ahead_ns = 0 if second < 30 else back_s * S
        sync.pass_time(second * S - ahead_ns)
        for node in (3, 4, 5):
            earlier_ns = (second - 1) * S + node * 20 * MS
            beacon = said(earlier_ns, second - 1, node=node, hops=1, error_ns=8 * US)
            hear(sync, node, second, second * S + node * 20 * MS - ahead_ns, beacon)
    if back_s * S < LIMIT_NS:
        assert abs(sync.line.swarm_ns(36 * S - ahead_ns) - 36 * S) < 10 * US
    else:
        assert sync.reference is None, "this clock can never agree with the swarm's"


def test_a_reference_that_comes_back_with_a_time_and_rounds_of_its_own_is_followed_at_once() -> None:
    """It has led for 300 s; away from the others it starts again, by a clock that is 30 ms off, and counts from 0."""
    sync = follower()
    follow(sync, ahead_ns=25 * MS, hellos=300)
    for now_s in range(301, 341):
        sync.hello_sent(now_s, ended_ns=now_s * S)
        sync.beacon(now_s * S)
    assert sync.is_reference, "nobody else was left"
    for number in range(1, 9):
        now_ns = (340 + number) * S
        earlier = said(now_ns - S + 55 * MS, number - 1)._replace(round=number)
        hear(sync, 1, number, now_ns, earlier if number > 1 else None)
    assert (sync.reference, sync.is_reference) == (1, False)
    assert abs(sync.line.swarm_ns(348 * S) - (348 * S + 55 * MS)) < 100 * US


def test_two_swarms_that_meet_take_the_time_of_the_lower_reference() -> None:
    links = {1: [2], 2: [1], 3: [4], 4: [3]}
    network = Network(links, CRYSTAL, seed=8)
    network.run(50)
    assert network.members[4].sync.reference == 3
    links[2].append(3)
    links[3].append(2)
    network.run(80)
    assert {member.sync.reference for member in network.members.values()} == {1}
    assert network.worst_us() < 20


def test_a_time_that_is_known_badly_at_first_is_not_held_to_be_that_of_the_reference_before() -> None:
    """Two words within 1 ms contradict nothing, and lie 0.4 ms off; a third one, within 0.3 ms, finds no old line."""
    sync = follower(9)
    follow(sync, ahead_ns=0, hellos=20, src=3, reference=3)
    assert sync.reference == 3
    follow(sync, ahead_ns=400 * US, hellos=3, src=5, first=21, hops=9, error_ns=MS)
    hear(sync, 5, 24, 24 * S, said(23 * S + 400 * US, 23, node=5, hops=9, error_ns=300 * US))
    assert sync.reference == 1
    stated_ns = sync.error_ns(24 * S)
    assert stated_ns is not None
    assert abs(sync.line.swarm_ns(24 * S) - 24 * S - 400 * US) <= stated_ns


def test_a_time_farther_than_the_limit_is_counted_and_not_believed() -> None:
    sync = follower()
    follow(sync, ahead_ns=6 * S, hellos=20)
    assert not sync.synced
    assert sync.counts["implausible"] == 19
    follow(sync, ahead_ns=1 << 60, hellos=3, first=30)
    assert not sync.synced


def test_a_clock_that_can_never_agree_with_the_swarm_does_not_set_up_another_time() -> None:
    sync = follower()
    follow(sync, ahead_ns=6 * S, hellos=60)
    sync.pass_time(60 * S)
    assert not sync.synced
    assert not sync.is_reference


def test_one_liar_among_honest_neighbors_moves_nothing_whenever_it_begins() -> None:
    for first in (1, 12):
        sync = follower(5)
        for hello in range(1, 40):
            for src, ahead_ns in ((2, 30 * MS), (3, 30 * MS), (4, 2 * S)):
                if src == 4 and hello < first:
                    continue
                beacon = said((hello - 1) * S + ahead_ns, hello - 1, node=src, hops=1) if hello > 1 else None
                hear(sync, src, hello, hello * S, beacon)
        assert abs(sync.line.swarm_ns(40 * S) - (40 * S + 30 * MS)) < 10 * US
        assert sync.counts["outlier"] >= 20


def test_a_liar_brings_nobody_nearer_to_the_reference() -> None:
    """Nodes 3 and 4 are three hops from it; node 5, which states another time, says that it is beside it."""
    sync = follower()
    for hello in range(1, 7):
        for src, ahead_ns, hops in ((3, 0, 3), (4, 0, 3), (5, 30 * MS, 1)):
            beacon = said((hello - 1) * S + ahead_ns, hello - 1, node=src, hops=hops) if hello > 1 else None
            hear(sync, src, hello, hello * S, beacon)
    assert sync.hops(6 * S) == 4


def test_a_liar_that_is_the_first_to_tell_the_time_is_not_believed_for_a_moment() -> None:
    sync = follower(5)
    for hello in range(1, 12):
        for src, ahead_ns in ((4, 2 * S), (2, 30 * MS), (3, 30 * MS)):
            beacon = said((hello - 1) * S + ahead_ns, hello - 1, node=src, hops=1) if hello > 1 else None
            hear(sync, src, hello, hello * S, beacon)
            assert abs(sync.line.offset_at(hello * S)) < 31 * MS
    assert abs(sync.line.swarm_ns(12 * S) - (12 * S + 30 * MS)) < 10 * US
    assert sync.counts["doubted"] == 2


def test_who_hears_of_a_time_that_it_doubts_does_not_set_up_another() -> None:
    """A leader that starts again in the last moment of its listening, beside one neighbor."""
    leader = follower(1, leads=True)
    hear(leader, 2, 1, 1400 * MS, None)
    hear(leader, 2, 2, 2400 * MS, said(1400 * MS + 30 * MS, 1, node=2, hops=1))
    leader.pass_time(2600 * MS)
    assert not leader.is_reference
    hear(leader, 2, 3, 3400 * MS, said(2400 * MS + 30 * MS, 2, node=2, hops=1))
    leader.pass_time(3800 * MS)
    hear(leader, 2, 4, 4400 * MS, said(3400 * MS + 30 * MS, 3, node=2, hops=1))
    leader.pass_time(4500 * MS)
    assert abs(leader.line.swarm_ns(4500 * MS) - 4530 * MS) < 100 * US


def test_a_liar_that_talks_ten_times_as_fast_has_no_more_votes() -> None:
    sync = follower(5)
    follow(sync, ahead_ns=30 * MS, hellos=6)
    for hello in range(60, 120):
        ended_ns = hello * S // 10
        hear(sync, 4, hello, ended_ns, said(ended_ns - S // 10 + 2 * S, hello - 1, node=4, hops=1))
    assert sync.counts["hasty"] > 30
    follow(sync, ahead_ns=30 * MS, hellos=20, first=13)
    assert abs(sync.line.swarm_ns(33 * S) - (33 * S + 30 * MS)) < 50 * US


def test_a_beacon_in_anothers_name_is_counted() -> None:
    sync = follower()
    hear(sync, 1, 1, S, None)
    hear(sync, 1, 2, 2 * S, said(S, 1, node=9, reference=1, hops=1))
    assert not sync.synced
    assert sync.counts["foreign"] == 1


def test_neighbors_without_end_are_not_remembered_without_end() -> None:
    sync = follower()
    for src in range(3, 3000):
        hear(sync, src, 1, src * MS, said(0, 0, node=src, hops=7))
    assert len(sync._neighbors) == 256


def test_the_greatest_error_of_the_swarm_is_known_everywhere_and_forgotten_when_it_is_old() -> None:
    sync = follower()
    follow(sync, ahead_ns=0, hellos=10)
    far = said(10 * S, 10)._replace(worst_ns=3 * MS, worst_age_s=4)
    hear(sync, 1, 11, 11 * S, far)
    assert sync.worst_ns(12 * S) == 3 * MS
    assert sync.worst_ns(11 * S + 17 * S) < MS
    absurd = said(11 * S, 11)._replace(worst_ns=0xFFFF_FFFF)
    hear(sync, 1, 12, 12 * S, absurd)
    assert sync.worst_ns(13 * S) == 20 * MS, "no guard is made for more"


def test_a_node_says_how_well_it_knows_its_rate_and_one_that_follows_it_counts_on_it() -> None:
    sync = follower()
    follow(sync, ahead_ns=0, hellos=2)
    sync.hello_sent(1, ended_ns=2 * S)
    young = sync.beacon(2 * S)
    assert young is not None
    assert young.rate_ppb == 40_000, "one pair: all that two clocks may run apart"
    follow(sync, ahead_ns=0, hellos=20, first=3)
    settled = sync.beacon(22 * S)
    assert settled is not None
    assert 0 < settled.rate_ppb < 500
    grown_ns = []
    for rate_ppb in (young.rate_ppb, settled.rate_ppb):
        other = follower(3)
        for hello in range(1, 12):
            about = said((hello - 1) * S, hello - 1, node=2, hops=1)._replace(rate_ppb=rate_ppb)
            hear(other, 2, hello, hello * S, about if hello > 1 else None)
        later, now = other.error_ns(20 * S), other.error_ns(10 * S)
        assert later is not None
        assert now is not None
        grown_ns.append(later - now)
    assert grown_ns[0] > grown_ns[1] + 300 * US


def test_a_neighbor_whose_hellos_are_of_another_time_is_out_of_step_after_nine_hellos() -> None:
    sync = follower()
    follow(sync, ahead_ns=25 * MS, hellos=5)
    sync.on_old_hello(NodeId(3), 5 * S)
    for second in range(6, 17):
        sync.on_old_hello(NodeId(3), second * S)
        assert sync.counts["apart"] == max(0, second - 14), "it may be one hello that others have recorded"
