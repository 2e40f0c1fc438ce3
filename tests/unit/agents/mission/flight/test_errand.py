"""A UAV that was ordered to search around a place flies a spiral over it, and sees every spot within the radius."""

import math
from itertools import pairwise

import pytest
from search_board import OPEN

from agents.mission.flight.errand import Errand
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.orders import KnownOrders
from fanet_mw.orders import Order, OrderKind
from fanet_mw.units import Enu, NodeId, S
from fanet_mw.wire.search_messages import ToldOrder

NODE = NodeId(3)
MIDDLE, HEIGHT_M, SPEED_M_S, LOOK_M = Enu(100.0, -50.0, 40.0), 40.0, 8.0, 25.0


class Ordered:
    """An errand with its UAV, which is where it was put."""

    def __init__(self, kind: OrderKind = OrderKind.SEARCH, *, radius_m: float = 90.0, look_m: float = LOOK_M) -> None:
        self.orders, self.motion = KnownOrders(NODE), OwnMotion(MIDDLE, OPEN)
        self.errand = Errand(self.orders, self.motion, height_m=HEIGHT_M, speed_m_s=SPEED_M_S, look_m=look_m)
        self._serial = 0
        self.order(kind, radius_m=radius_m)

    def order(self, kind: OrderKind, *, radius_m: float = 0.0) -> None:
        self._serial += 1
        order = Order(kind, NODE, MIDDLE.east, MIDDLE.north, radius_m)
        self.orders.learn(ToldOrder(0, 9, self._serial, order), 0)

    def goal(self, now_ns: int) -> Enu:
        goal = self.errand.goal(now_ns)
        assert goal is not None
        return goal

    def track(self, seconds: int) -> list[Enu]:
        return [self.goal(step * S // 10) for step in range(10 * seconds)]


ENDS_M = 90 + 0.6 * LOOK_M
"""How far from the middle the spiral leads: the turn before the last is 40 m nearer and looks 25 m outwards."""
WHOLE_S = math.pi * ENDS_M**2 / (1.6 * LOOK_M * SPEED_M_S)


def test_one_search_passes_every_spot_within_its_radius() -> None:
    flown = Ordered().track(round(WHOLE_S))
    for far_m in range(0, 91, 15):
        for angle in range(0, 360, 30):
            spot = Enu(
                MIDDLE.east + far_m * math.cos(math.radians(angle)),
                MIDDLE.north + far_m * math.sin(math.radians(angle)), HEIGHT_M,
            )  # fmt: skip
            assert min(at.minus(spot).norm() for at in flown) <= LOOK_M, (far_m, angle)
    assert all(at.minus(MIDDLE).norm() <= ENDS_M for at in flown)


def test_a_spiral_winds_outward_at_the_speed_of_its_uav() -> None:
    flown = Ordered().track(70)
    far_m = [at.minus(MIDDLE).norm() for at in flown]
    assert far_m == sorted(far_m)
    turned = far_m.index(next(far for far in far_m if far > 1.6 * LOOK_M))
    for a, b in pairwise(flown[turned:]):
        assert b.minus(a).norm() == pytest.approx(0.1 * SPEED_M_S, rel=0.05)


def test_who_sees_nothing_flies_turns_as_wide_as_receivers_reach() -> None:
    wide = Ordered(radius_m=400.0, look_m=math.inf)
    pitch_m = 1.6 * 60
    assert wide.goal(0).minus(MIDDLE).norm() == 0
    once_ns = round(math.pi * pitch_m / SPEED_M_S * S)
    assert wide.goal(once_ns).minus(MIDDLE).norm() == pytest.approx(pitch_m, rel=1e-6)
    assert wide.goal(4 * once_ns).minus(MIDDLE).norm() == pytest.approx(2 * pitch_m, rel=1e-6)


def test_when_all_is_seen_a_search_begins_anew_in_the_middle() -> None:
    search = Ordered()
    search.goal(0)
    assert search.goal(round((WHOLE_S - 0.01) * S)).minus(MIDDLE).norm() == pytest.approx(ENDS_M, abs=0.1)
    assert search.goal(round((WHOLE_S + 0.01) * S)).minus(MIDDLE).norm() < 2


def test_a_search_begins_once_the_uav_is_within_twenty_metres() -> None:
    search = Ordered()
    for metres, there in ((20.1, False), (20.0, True), (300.0, True)):
        search.motion.position = MIDDLE._replace(north=MIDDLE.north + metres, up=90.0)
        now_ns = round(1000 - metres) * S
        search.goal(now_ns)
        assert (search.goal(now_ns + 10 * S) != MIDDLE) == there, metres
        assert search.goal(now_ns).up == HEIGHT_M


def test_who_is_to_stay_flies_over_the_place_and_the_released_nowhere() -> None:
    stay = Ordered(OrderKind.STAY)
    assert [stay.goal(second * S) for second in (0, 10, 100)] == 3 * [MIDDLE]
    stay.order(OrderKind.RELEASE)
    assert stay.errand.goal(200 * S) is None


def test_another_order_is_carried_out_from_its_beginning() -> None:
    search = Ordered()
    search.track(30)
    search.order(OrderKind.SEARCH, radius_m=60.0)
    assert search.goal(30 * S) == MIDDLE
    search.motion.position = Enu(500, 0, 40)
    assert search.goal(31 * S) != MIDDLE, "it has been there"
    search.order(OrderKind.SEARCH, radius_m=70.0)
    assert search.goal(32 * S) == search.goal(40 * S) == MIDDLE
