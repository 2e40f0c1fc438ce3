"""A swarm from which UAVs are lost, one after the other, is one network again within 15 s each time; parts of a swarm
that do not hear each other keep clear of each other.
"""

import pytest
from closing_swarm import ClosingSwarm
from kit import slow
from search_board import COUNT, REACH_M, UP_M

from agents.mission.search_formation.formation_planner import plan_of
from agents.mission.search_formation.pattern import Pattern
from agents.mission.search_formation.shapes.contract import Dimensions
from fanet_mw.units import Enu

_NODES = (
    28, 37, 38, 29, 39, 30, 31, 41, 42, 43, 44, 35, 34, 45, 27, 19, 10, 1, 2, 12, 3, 4, 5, 6, 16, 7, 8, 9, 18, 36, 40,
    32, 22, 21, 23, 33, 13, 24, 25, 15, 20, 11, 14, 17, 26,
)  # fmt: skip
"""Who flies to which place from a grid with steps of 200 m."""
NORTHERN, SOUTHERN = 8, 23
"""The UAVs of the two lines at which the chain ends."""


@pytest.mark.parametrize(
    ("from_s", "lost", "why"),
    [
        (153.3, [16, 26, 38, 28], "three of a line that turns back"),
        *slow(
            (12.7, [1, 39, 3, 7], "four of one line: who is beyond a gap has moved before"),
            (115.5, [SOUTHERN, 14, 25, 6], "where the chain ends, and others of both lines"),
        ),
        (139.6, [32], "the second relay: the first one cannot come nearer, and may not go away again"),
    ],
)
def test_who_is_left_is_one_network_again_within_15_s_of_each_loss(from_s: float, lost: list[int], why: str) -> None:
    swarm = ClosingSwarm(from_s)
    heal_s = [swarm.heal_s(node, within_s=15.0) for node in lost[:-1]] + [swarm.heal_s(lost[-1], within_s=20.0)]
    assert max(heal_s) <= 15.0, (heal_s, why)
    assert max(heal_s) > 4.0, "gaps that have to be closed"


def test_two_relays_beside_each_other_are_missed_by_both_sides() -> None:
    assert ClosingSwarm(92.0).heal_s(33, 34, within_s=15.0) < 13.0, "each side knew only one of them as its neighbor"


@pytest.mark.parametrize(
    ("from_s", "lost", "within_s"),
    [(110.0, [33, 34], 16.0), (130.0, [31, 35], 14.0), (145.0, [34, 38], 16.8), *slow((140.0, [32], 12.0))],
)
def test_a_line_waits_for_its_chain_that_closes_a_gap_near_it(from_s: float, lost: list[int], within_s: float) -> None:
    """A line that flies on pulls the end of the chain away: 22.4, 17.2 and 23.4 s. Who is between two gaps follows
    neither side: 17.6 s if it does (the third case). Of two gaps that which has healed counts no more: 21.4 s.
    """
    assert ClosingSwarm(from_s).heal_s(*lost, within_s=25.0) < within_s


@pytest.mark.parametrize(("from_s", "relay"), [(100.0, 33), *slow((60.0, 32))])
def test_a_chain_that_closes_ranks_flies_around_a_lost_relay_that_hovers_in_its_way(from_s: float, relay: int) -> None:
    assert ClosingSwarm(from_s).nearest_to_m(relay, for_s=40.0) > 10.0, "0.3 and 0 m where nobody thinks of it"


@pytest.mark.parametrize(
    ("from_s", "lost", "within_s"),
    [(-29.6, 41, 8.0), *slow((-24.6, 42, 4.0), (-39.6, 27, 7.0))],
)
def test_on_the_way_to_the_places_parts_fly_to_meet_each_other(from_s: float, lost: int, within_s: float) -> None:
    """Each would be alone until its place is near the others': 14.6, 9.6 and 13.2 s."""
    made = Dimensions(15, 10, 5, 1205.0, 300.0, 1225.0, UP_M, 7.5)
    plan = plan_of(Pattern(made, reach_m=REACH_M), _NODES, planner=1, start_us=7_000_000, deploy_ds=496)
    starts = [Enu((one % 9 - 4) * 200.0, (one // 9 - 2) * 200.0, UP_M) for one in range(COUNT)]
    assert 1.0 < ClosingSwarm(from_s, plan=plan, starts=starts).heal_s(lost, within_s=20.0) < within_s


@pytest.mark.slow
def test_of_two_lost_at_once_the_second_one_that_is_noticed_makes_nobody_seek_others_where_they_are_not_yet() -> None:
    first, second = 45, 32  # a follower, and a relay, which is missed later
    assert 4.0 < ClosingSwarm(102.5).heal_s(first, second, within_s=15.0) < 7.0


@pytest.mark.parametrize(("from_s", "along", "off_m"), [(60.2, 1.71, -187.0), (77.3, 2.12, 226.0), (184.0, 1.52, -3.0)])
@pytest.mark.slow
def test_parts_that_take_each_other_for_lost_and_close_the_same_gap_keep_clear(
    from_s: float, along: float, off_m: float
) -> None:
    assert ClosingSwarm(from_s).nearest_m(along=along, off_m=off_m, for_s=20.0) > 5.0
