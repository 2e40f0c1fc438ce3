"""A swarm over links that lose frames, with timetables from measured links: what arrives, and what its nodes state."""

from collections import Counter

import pytest
from kit import slow

from fanet_mw.scenario import Scenario
from fanet_mw.trace import BoundExcludes, BoundStated, Delivered, Dropped, Generated, LikelyStated
from fanet_mw.units import S
from sim.run.virtual import simulate
from sim.scenarios.catalog import find

SMALL = ("nodes.count=12", "clusters.count=11", "traffic.sources=11", "duration_s=40", "warmup_s=24", "drain_s=8")
STIRRED = "radio.scatterer_speed_m_s=100"  # the swarm is at rest: without it links would keep their fades
LOSSY = ('radio.channel="log_distance"', 'radio.fading="rician"', STIRRED)


def scenario(*overrides: str) -> Scenario:
    return find("clusters", [*SMALL, *overrides])


def test_links_are_measured_where_frames_fade_unless_places_are_wanted() -> None:
    assert not scenario().measures_links
    assert not scenario('radio.channel="log_distance"').measures_links
    assert scenario(*LOSSY).measures_links
    assert scenario('radio.channel="log_distance"', "radio.shadowing_db=4").measures_links
    assert not scenario(*LOSSY, 'clusters.links="places"').measures_links
    assert scenario('clusters.links="measured"').measures_links


@pytest.mark.parametrize("loss", ['radio.fading="rician"', *slow("radio.shadowing_db=4")])
def test_each_packet_over_lossy_links_arrives_within_what_was_stated_for_it(loss: str) -> None:
    outcome = simulate(scenario('radio.channel="log_distance"', loss, STIRRED))
    born = {(r.node, r.seq): r.t_ns for r in outcome.records if isinstance(r, Generated)}
    stated = {(r.node, r.seq): r for r in outcome.records if isinstance(r, LikelyStated)}
    assert stated.keys() == born.keys(), "a packet behind others has a longer delay stated, not none"
    assert all(record.share == 0.99 for record in stated.values())
    arrived = [r for r in outcome.records if isinstance(r, Delivered)]
    in_time = sum(r.t_ns - born[r.origin, r.seq] <= stated[r.origin, r.seq].delay_ns for r in arrived)
    assert in_time / (11 * len(born)) >= 0.99
    assert max(record.delay_ns for record in stated.values()) < 10 * S
    assert not any(isinstance(record, BoundStated) for record in outcome.records)


@pytest.mark.slow
def test_once_the_leader_plans_without_a_lost_node_likely_delays_are_stated_again() -> None:
    lost = 'faults=[{kind="mute", node=12, at_s=24}]'
    outcome = simulate(scenario(*LOSSY, lost, "duration_s=70"))
    born = [(r.node, r.seq) for r in outcome.records if isinstance(r, Generated) and r.t_ns > 58 * S and r.node != 12]
    stated = {(r.node, r.seq) for r in outcome.records if isinstance(r, LikelyStated)}
    without = {(r.node, r.seq) for r in outcome.records if isinstance(r, BoundExcludes) and r.other == 12}
    assert sum(packet in stated and packet in without for packet in born) >= 0.9 * len(born) > 20


def test_the_same_swarm_with_places_leaves_out_a_part() -> None:
    """What the test above would not notice if the channel lost nothing."""
    outcome = simulate(scenario(*LOSSY, 'clusters.links="places"', "clusters.resume=false"))
    born = sum(isinstance(record, Generated) for record in outcome.records)
    arrived = sum(isinstance(record, Delivered) for record in outcome.records)
    assert arrived / (11 * born) < 0.9


def test_no_delay_is_stated_that_is_longer_than_packets_live() -> None:
    lossy = ('radio.channel="log_distance"', 'radio.fading="rician"', STIRRED, "routing.lifetime_s=0.8")
    outcome = simulate(scenario(*lossy, "duration_s=36"))
    assert any(isinstance(record, Generated) for record in outcome.records)
    stated = [record for record in outcome.records if isinstance(record, LikelyStated)]
    assert all(record.delay_ns <= 0.8 * S for record in stated)


def test_a_packet_that_may_expire_before_its_turn_has_no_bound() -> None:
    """Three reports a second in turns of half a second: some wait for longer than they live."""
    reports = (
        "mission.survivors=4",
        "mission.reports_to_approach=100",
        "mission.report_interval_s=0.3",
        "world.area_m=600",
    )
    size = ("nodes.count=9", "clusters.count=8", "traffic.sources=8", "warmup_s=10", "duration_s=16")
    outcome = simulate(find("clusters", [*size, *reports, "routing.report_lifetime_s=0.3"]))
    stated = {(r.node, r.seq) for r in outcome.records if isinstance(r, BoundStated) and r.t_ns < 15 * S}
    arrived = Counter((r.origin, r.seq) for r in outcome.records if isinstance(r, Delivered))
    assert any(isinstance(r, Dropped) and r.reason == "expired" for r in outcome.records)
    assert len(stated) > 20
    assert all(arrived[packet] == 8 for packet in stated)
