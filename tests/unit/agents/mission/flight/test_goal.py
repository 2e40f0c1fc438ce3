"""Where a searching UAV flies: to its lane, or to somebody who was heard."""

import pytest
from search_board import LINE, TAKEN_UP_NS, Board, lane_of

from agents.mission.finding.phone_localization import Estimate
from fanet_mw.units import Enu, S


@pytest.mark.parametrize("is_seen", [False, True])
def test_a_uav_of_a_line_stays_on_its_lane_if_its_camera_shows_the_place_from_there(*, is_seen: bool) -> None:
    now_ns = TAKEN_UP_NS + 60 * S
    lane = lane_of(LINE, now_ns)
    board, survivor = Board(LINE, lane, look_m=65.0), Enu(lane.east + 45, lane.north + 80, 0)
    board.hear(1, survivor, range(1, 5), now_ns=now_ns)
    if is_seen:
        board.survivors.by_id[1].filter.on_sighting(Estimate(survivor.east, survivor.north, 1.0, 0.0, 1.0))
    goal, _ = board.goal.at(1, now_ns)
    assert goal.east == (pytest.approx(survivor.east) if is_seen else lane.east)
    assert goal.north > lane.north + 40
