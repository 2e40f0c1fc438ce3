"""Which links last: by where both nodes are, and how they fly."""

import pytest

from fanet_mw.motion import Motion
from fanet_mw.routing.rounds.counted_links import LastingLinks
from fanet_mw.units import STILL, Enu, NodeId, S

OTHER = NodeId(3)
BIT = 1 << (OTHER - 1)
OWN = Motion(Enu(0.0, 0.0, 50.0), Enu(10.0, 0.0, 0.0), 0)


@pytest.mark.parametrize(
    ("at_m", "speed_m_s", "lasts"),
    [
        (240.0, 10.0, True),  # flies along, however near the edge
        (-200.0, 10.0, True),
        (100.0, -10.0, True),  # comes, passes, and is near after that
        (-150.0, -10.0, False),  # 150 m behind, both fly away from each other: 250 m after 5 s
        (240.0, 9.0, True),  # comes nearer
        (240.0, 20.0, False),
        (260.0, 10.0, False),  # out of range already
    ],
)
def test_a_link_lasts_if_both_are_in_range_for_the_horizon(at_m: float, speed_m_s: float, lasts: bool) -> None:
    links = LastingLinks(range_m=250.0, horizon_ns=6 * S, noticed_ns=2 * S)
    links.hear(OTHER, Motion(Enu(at_m, 0.0, 50.0), Enu(speed_m_s, 0.0, 0.0), 0))
    assert links.among(BIT | 1, OWN) == (BIT if lasts else 0) | 1


@pytest.mark.parametrize(("ends_s", "lasts"), [(6, False), (6.1, True)])
def test_a_link_lasts_only_as_long_as_its_line_of_sight_even_to_who_is_kept_in_reach(
    ends_s: float, *, lasts: bool
) -> None:
    links = LastingLinks(range_m=250.0, horizon_ns=6 * S, noticed_ns=2 * S)
    links.hear(OTHER, Motion(Enu(100.0, 0.0, 50.0), OWN.velocity, 0))
    links.held = BIT
    links.sight_ends_ns = {OTHER: round(ends_s * S)}
    assert links.among(BIT | 1, OWN) == (BIT if lasts else 0) | 1
    links.sight_ends_ns = {}
    assert links.among(BIT | 1, OWN) == BIT | 1


def test_a_link_that_was_given_up_counts_again_only_with_a_margin() -> None:
    links = LastingLinks(range_m=250.0, horizon_ns=6 * S, noticed_ns=2 * S)
    leaving = Motion(Enu(200.0, 0.0, 50.0), Enu(20.0, 0.0, 0.0), 0)
    links.hear(OTHER, leaving)
    assert not links.among(BIT, OWN)
    links.hear(OTHER, leaving._replace(velocity=Enu(17.0, 0.0, 0.0)))
    assert not links.among(BIT, OWN), "it lasts for 6 s now, but not for 9"
    links.hear(OTHER, leaving._replace(velocity=Enu(12.0, 0.0, 0.0)))
    assert links.among(BIT, OWN)


def test_a_link_lasts_however_fast_both_part_if_this_node_keeps_the_other_in_reach() -> None:
    links = LastingLinks(range_m=250.0, horizon_ns=6 * S, noticed_ns=2 * S)
    links.hear(OTHER, Motion(Enu(200.0, 0.0, 50.0), Enu(20.0, 0.0, 0.0), 0))
    links.held = BIT
    assert links.among(BIT, OWN) == BIT
    links.held = 0
    assert not links.among(BIT, OWN._replace(at_ns=2 * S))


def test_who_was_kept_in_reach_until_just_now_counts_unless_it_is_gone_before_that_is_noticed() -> None:
    for speed_m_s, later_ns, counts in ((30.0, S, True), (40.0, S, False), (30.0, S + 1, False)):
        links = LastingLinks(range_m=250.0, horizon_ns=6 * S, noticed_ns=2 * S)
        links.hear(OTHER, Motion(Enu(200.0, 0.0, 50.0), Enu(speed_m_s, 0.0, 0.0), 0))
        links.held = BIT
        assert links.among(BIT, OWN) == BIT
        links.held = 0
        links.hear(OTHER, Motion(Enu(200.0, 0.0, 50.0), Enu(speed_m_s, 0.0, 0.0), later_ns))
        assert links.among(BIT, OWN._replace(at_ns=later_ns)) == (BIT if counts else 0)


def test_where_somebody_was_before_it_was_away_says_nothing_when_it_is_heard_again() -> None:
    links = LastingLinks(range_m=250.0, horizon_ns=6 * S, noticed_ns=2 * S)
    links.hear(OTHER, Motion(Enu(0.0, 240.0, 50.0), Enu(0.0, -10.0, 0.0), 0))
    assert not links.among(BIT, OWN._replace(at_ns=5 * S, position=Enu(300.0, 0.0, 50.0)))
    assert links.among(BIT, OWN._replace(at_ns=60 * S)) == BIT, "it is heard, so it is somewhere near"
    assert not links.gone


def test_links_with_a_post_that_has_an_antenna_of_its_own_reach_farther() -> None:
    links = LastingLinks(range_m=250.0, horizon_ns=6 * S, noticed_ns=2 * S, reaches={OTHER: 5.6})
    for east_m, lasts in ((-1300.0, True), (-1350.0, False)):
        links.hear(OTHER, Motion(Enu(east_m, 0.0, 0.0), STILL, 0))
        assert links.among(BIT, OWN) == (BIT if lasts else 0)
        assert not links.gone


def test_who_should_be_out_of_range_by_now_is_gone() -> None:
    links = LastingLinks(range_m=250.0, horizon_ns=6 * S, noticed_ns=2 * S)
    links.hear(OTHER, Motion(Enu(200.0, 0.0, 50.0), Enu(20.0, 0.0, 0.0), 0))
    still = OWN._replace(velocity=STILL)
    for near, seconds, gone in ((BIT, 2, 0), (BIT, 3, BIT), (1, 3, 0)):
        links.among(near, still._replace(at_ns=seconds * S))
        assert links.gone == gone
