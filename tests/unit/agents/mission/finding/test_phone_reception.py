"""What a UAV takes from its neighbors' silence."""

from collections.abc import Sequence

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

FROM_THE_WEST = [Enu(-220 + 8 * second, 0, UP_M) for second in range(25)]
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
    assert heard_at_the_middle(reported=True) < -60, "received on both sides, it is between them"


def received_after(passed: Sequence[Enu], *, beside: bool = False, since_s: int = 0) -> Enu:
    """Where a phone is placed that this UAV receives once at the middle, `since_s` after it, or only a neighbor
    `beside` its way, has passed some places without receiving it.
    """
    survivors, neighbors = KnownSurvivors(MODEL), NeighborMotions()
    motion = OwnMotion(Enu(0, 0, UP_M), KnownObstacles(NO_MAP))
    reception = PhoneReception(SCENARIO, NodeId(9), survivors, motion, Outbox(), neighbors)
    for second, at in enumerate(passed):
        if beside:
            neighbors.on_hello(1, Motion(Enu(at.east, at.north - 100, at.up), STILL, second * S))
        else:
            motion.position = at
        reception.scan([], now_ns=second * S)
        reception.review(second * S)
    now_ns = (len(passed) + since_s) * S
    motion.position = Enu(0, 0, UP_M)
    reception.scan([(1, -88.0)], now_ns=now_ns)
    reception.review(now_ns)
    place = survivors.by_id[1].filter.estimate()
    assert place is not None
    return place.at


def test_a_phone_that_is_received_first_lies_ahead_and_not_where_its_receiver_has_come_from() -> None:
    assert received_after(FROM_THE_WEST).east > 40


def test_a_phone_lies_away_from_where_a_neighbor_has_come_from() -> None:
    assert received_after(FROM_THE_WEST, beside=True).north > 30


def test_where_nobody_listened_for_a_minute_a_phone_may_have_been_switched_on() -> None:
    assert abs(received_after(FROM_THE_WEST, since_s=70).east) < 10
