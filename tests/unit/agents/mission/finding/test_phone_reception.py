"""What a UAV takes from its neighbors' silence."""

from search_board import MODEL, SCENARIO, UP_M

from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.phone_reception import PhoneReception
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.onboard_map import NO_MAP
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from fanet_mw.motion import Motion
from fanet_mw.units import STILL, US, Enu, NodeId, S
from fanet_mw.wire.survivors import Survivor

WEST = (Enu(-120, 0, UP_M), Enu(-100, 120, UP_M), Enu(-100, -120, UP_M))


def heard_at_the_middle(*, reported: bool) -> float:
    """How far to the east a phone is placed that this UAV has received once, while others fly west of it."""
    survivors, neighbors = KnownSurvivors(MODEL), NeighborMotions()
    motion = OwnMotion(Enu(0, 0, UP_M), KnownObstacles(NO_MAP))
    reception = PhoneReception(SCENARIO, NodeId(9), survivors, motion, Outbox(), neighbors)
    reception.scan([(1, -88.0)], now_ns=0)
    for second in range(1, 13):
        for node, at in enumerate(WEST, start=1):
            neighbors.on_hello(node, Motion(at, STILL, second * S))
            if reported:
                survivors.take_report(Survivor(second * S // US, 1, node, at, -88.0), now_ns=second * S)
        reception.scan([(1, -88.0)], now_ns=second * S)
        reception.review(second * S)
    place = survivors.by_id[1].filter.estimate()
    assert place is not None
    return place.east_m


def test_a_neighbor_that_reports_nothing_tells_where_a_phone_is_not() -> None:
    assert heard_at_the_middle(reported=False) > 60
    assert heard_at_the_middle(reported=True) < -20, "received on both sides, it is between them"
