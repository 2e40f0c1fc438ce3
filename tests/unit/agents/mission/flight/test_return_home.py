"""UAVs whose pads are beside each other land in turns."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import pytest
from kit import MakeScenario

from agents.mission.flight.return_home import ReturnHome, ReturnReason
from agents.mission.flight.search_limits import SearchLimits
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.onboard_map import NO_MAP
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from fanet_mw.motion import Motion
from fanet_mw.units import MS, STILL, Enu, NodeId, S

TICK_NS: Final = 200 * MS
HOMEWARD_M_S, SINK_M_S = 8.0, 1.5


class Homecoming:
    """UAVs that fly straight to the goals of their returns, and hear each other."""

    def __init__(self, make_scenario: MakeScenario, *, pads: Sequence[Enu], starts: Sequence[Enu]) -> None:
        limits = SearchLimits(make_scenario())
        self.pads, self.at = pads, list(starts)
        self.own = [OwnMotion(start, KnownObstacles(NO_MAP)) for start in starts]
        self.heard = [NeighborMotions() for _ in pads]
        nodes = range(1, len(pads) + 1)
        self.returns = [
            ReturnHome(
                NodeId(node), pad, own, heard, Outbox(), speed_m_s=10.0, airspeed_m_s=19.0,
                height_m=65.0, limits=limits, fixes_hz=5.0, beside={*nodes} - {node},
            )
            for node, pad, own, heard in zip(nodes, pads, self.own, self.heard, strict=True)
        ]  # fmt: skip
        self.flown = [STILL for _ in pads]
        self.landed_s: dict[int, float] = {}
        self.nearest_m = float("inf")
        """The least distance of two that are over the pads and on one level; elsewhere they avoid each other."""
        self.now_ns = 0

    def fly(self, seconds: float) -> None:
        until_ns = self.now_ns + round(seconds * S)
        while self.now_ns < until_ns:
            for row, here in enumerate(self.at):
                for other, heard in enumerate(self.heard):
                    if other != row:
                        heard.on_hello(row + 1, Motion(here, self.flown[row], self.now_ns))
            before, self.at = self.at, [self._moved(row, here) for row, here in enumerate(self.at)]
            moves = [at.minus(was) for at, was in zip(self.at, before, strict=True)]
            self.flown = [Enu(*(S / TICK_NS * part for part in move)) for move in moves]
            for row, one in enumerate(self.at):
                for other in self.at[:row]:
                    over = max(at.minus(self.pads[0]).horizontal() for at in (one, other))
                    if over < 20.0 and min(one.up, other.up) > 1.0 and abs(one.up - other.up) < 5.0:
                        self.nearest_m = min(self.nearest_m, one.minus(other).horizontal())
            self.now_ns += TICK_NS

    def _moved(self, row: int, here: Enu) -> Enu:
        own, back = self.own[row], self.returns[row]
        step_s = TICK_NS / S
        own.fix(here, self.flown[row], now_ns=self.now_ns)
        if back.land_if_there(self.now_ns):
            self.landed_s.setdefault(row + 1, self.now_ns / S)
            return here._replace(up=max(0.0, here.up - SINK_M_S * step_s))
        off = back.goal(self.now_ns).minus(here)
        share = min(1.0, HOMEWARD_M_S * step_s / max(1e-9, off.horizontal()))
        return Enu(here.east + share * off.east, here.north + share * off.north, here.up)


def test_of_those_whose_pads_are_beside_each_other_one_sinks_at_a_time_and_nobody_waits_for_ever(
    make_scenario: MakeScenario,
) -> None:
    pads = [Enu(3.0 * (row % 3), 3.0 * (row // 3), 0.0) for row in range(6)]
    starts = [Enu(200.0 + 15.0 * row, -60.0 + 25.0 * row, 83.0) for row in range(6)]
    swarm = Homecoming(make_scenario, pads=pads, starts=starts)
    swarm.fly(180)
    assert sorted(swarm.landed_s) == [1, 2, 3, 4, 5, 6]
    instants = sorted(swarm.landed_s.values())
    assert min(late - early for early, late in pairwise(instants)) >= 5.0
    assert instants[-1] - instants[0] <= 5 * 14.0
    assert swarm.nearest_m > 8.0
    assert all(at.minus(pad).horizontal() <= 1.6 and at.up == 0.0 for at, pad in zip(swarm.at, pads, strict=True))


def test_who_hears_nobody_beside_its_pad_lands_at_once(make_scenario: MakeScenario) -> None:
    swarm = Homecoming(make_scenario, pads=[Enu(0, 0, 0)], starts=[Enu(80, 0, 83)])
    swarm.fly(15)
    assert swarm.landed_s[1] < 12.0


def test_a_uav_lands_on_its_pad_by_the_marker_although_its_receiver_errs_otherwise_than_as_it_stood_there(
    make_scenario: MakeScenario,
) -> None:
    one, true, drift = Alone(make_scenario), HOME._replace(east=HOME.east + 1.0), Enu(2.5, -1.5, 3.0)
    one.back.end()
    for tick in range(600):
        now_ns = tick * TICK_NS
        one.own.position = true.plus(drift, min(1.0, tick / 100))
        assert one.back.land_if_there(now_ns)
        if true.up < 30.0 and tick % 3 == 0:
            one.back.on_pad(Enu(HOME.east - true.east, HOME.north - true.north, -true.up), now_ns)
        course = one.out.course
        assert course is not None
        moves = course.velocity or Enu(0.0, 0.0, -SINK_M_S)
        true = true.plus(moves, TICK_NS / S)
        if true.up <= 0.0:
            break
    assert true.up <= 0.0
    assert one.out.course is not None
    assert one.out.course.land, "it touches down by the landing of its flight controller"
    assert true.horizontal_to(HOME) < 0.5


def test_right_over_its_pad_a_uav_sinks_by_the_marker_down_to_two_metres_and_then_straight(
    make_scenario: MakeScenario,
) -> None:
    one = Alone(make_scenario)
    one.back.end()
    assert one.lands(0.0, 0.0)
    for up_m, east_m, straight in ((20.0, 0.2, False), (2.1, 0.2, False), (1.9, 0.2, True), (1.5, 0.6, True)):
        one.own.position = Enu(HOME.east + east_m, HOME.north, up_m)
        one.back.on_pad(Enu(-east_m, 0.0, -up_m), 0)
        assert one.back.land_if_there(S)
        assert one.out.course is not None
        assert one.out.course.land == straight


def test_low_over_the_ground_beside_its_pad_a_uav_goes_there_first_and_lands_where_it_is_if_the_marker_is_hidden(
    make_scenario: MakeScenario,
) -> None:
    one = Alone(make_scenario)
    one.back.end()
    assert one.lands(0.0, 0.0)
    for up_m, sinks in ((5.0, True), (1.9, False)):
        one.own.position = Enu(HOME.east + 1.0, HOME.north, up_m)
        one.back.on_pad(Enu(-1.0, 0.0, -up_m), 0)
        assert one.back.land_if_there(S)
        course = one.out.course
        assert course is not None
        assert course.velocity is not None
        assert course.velocity.east < 0.0
        assert (course.velocity.up < 0.0) == sinks
    assert one.back.land_if_there(2 * S)
    assert one.out.course is not None
    assert one.out.course.land, "not seen for 2 s"


# --- rules of one return, at their bounds -----------------------------------------------------------------------------


class Alone:
    """A UAV above its base, or off it, and who it hears beside its pad."""

    def __init__(self, make_scenario: MakeScenario, *, node: int = 4, beside: frozenset[int] = frozenset()) -> None:
        self.limits, self.heard, self.out = SearchLimits(make_scenario()), NeighborMotions(), Outbox()
        self.own = OwnMotion(HOME, KnownObstacles(NO_MAP))
        self.back = ReturnHome(
            NodeId(node), HOME._replace(up=0.0), self.own, self.heard, self.out, speed_m_s=10.0, airspeed_m_s=19.0,
            height_m=65.0, limits=self.limits, fixes_hz=5.0, beside=beside,
        )  # fmt: skip

    def lands(self, east_m: float, north_m: float, velocity: Enu = STILL) -> bool:
        self.own.position, self.own.velocity = Enu(HOME.east + east_m, HOME.north + north_m, HOME.up), velocity
        return self.back.land_if_there(0)

    def off_home_m(self, east_m: float, north_m: float, **others: tuple[Enu, Enu]) -> float:
        """How far from its base the goal is; `others`: where who is beside it is from its base, and its velocity."""
        self.own.position = Enu(HOME.east + east_m, HOME.north + north_m, HOME.up)
        for name, (off, velocity) in others.items():
            at = Enu(HOME.east + off.east, HOME.north + off.north, HOME.up + off.up)
            self.heard.on_hello(int(name[1:]), Motion(at, velocity, 0))
        return self.back.goal(0).minus(HOME).horizontal()


HOME: Final = Enu(20.0, -30.0, 83.0)
"""The point above the base at which a UAV comes home."""


def test_a_uav_lands_within_a_metre_and_a_half_and_nearly_standing(make_scenario: MakeScenario) -> None:
    for east_m, north_m in ((1.5, 0.0), (0.0, -1.5), (-1.0, 1.0)):
        assert Alone(make_scenario).lands(east_m, north_m, Enu(0.3, 0.4, -2.0))
        assert not Alone(make_scenario).lands(1.01 * east_m, 1.1 * north_m, Enu(0.3, 0.41, 0.0))
    for off in (1.51, -1.51):
        assert not Alone(make_scenario).lands(off, 0.0)
        assert not Alone(make_scenario).lands(0.0, off)
    assert not Alone(make_scenario).lands(0.0, 0.0, Enu(0.3, 0.41, 0.0))


def test_who_lands_says_so_again_wherever_it_drifts(make_scenario: MakeScenario) -> None:
    one = Alone(make_scenario)
    assert one.lands(0.5, 0.5)
    assert one.lands(5.0, 0.0, Enu(1.0, 0.0, 0.0))
    assert one.out.course is not None
    assert one.out.course.land


def test_the_base_is_where_the_uav_says_that_it_stood(make_scenario: MakeScenario) -> None:
    one = Alone(make_scenario)
    one.own.position = Enu(23.0, -34.0, 0.2)
    one.back.stands_on_pad()
    assert one.back.goal(0) == Enu(23.0, -34.0, 83.0)
    assert not one.lands(0.0, 0.0)
    assert one.lands(3.0, -4.0)


def test_a_link_is_lost_after_the_silence_the_scenario_names(make_scenario: MakeScenario) -> None:
    one = Alone(make_scenario)
    one.limits.lost_link_ns = 20 * S
    assert not one.back.loses_link(100 * S), "who has heard nobody has no link"
    one.back.on_heard(100 * S)
    assert not one.back.loses_link(120 * S - 1)
    assert one.back.loses_link(120 * S)
    assert (one.back.leaves, one.back.percent) == (True, 0)
    assert not one.back.loses_link(121 * S), "it has gone"
    assert one.back.on_heard(130 * S)
    assert not one.back.leaves
    assert not one.back.on_heard(131 * S), "it is there"
    assert one.back.loses_link(151 * S)
    one.lands(0.0, 0.0)
    assert not one.back.on_heard(152 * S), "who lands lands"


def test_a_uav_says_what_of_its_battery_it_may_spend_and_0_only_as_it_flies_home(make_scenario: MakeScenario) -> None:
    one = Alone(make_scenario)
    assert one.back.percent == 100, "nothing was read yet"
    for charge, percent in ((0.5, 50), (0.004, 1), (0.0, 0)):
        assert one.back.on_battery(one.limits.reserve + charge, now_ns=0) == (percent == 0)
        assert one.back.percent == percent


def test_only_the_recalled_are_released_before_they_land(make_scenario: MakeScenario) -> None:
    for reason, released in ((ReturnReason.RECALLED, True), (ReturnReason.DONE, False)):
        one = Alone(make_scenario)
        assert not one.back.release()
        one.back.end(reason)
        assert one.back.release() == released
        assert one.back.leaves != released
    one.back.end(ReturnReason.RECALLED)
    assert one.back.reason is ReturnReason.DONE, "the first reason stays"
    late = Alone(make_scenario)
    late.back.end(ReturnReason.RECALLED)
    late.lands(0.0, 0.0)
    assert not late.back.release()


@pytest.mark.parametrize(
    ("here_m", "other", "off", "velocity", "waits"),
    [
        (60.0, 3, Enu(10, 0, 0), STILL, True),  # who is over the pads has its turn
        (60.0, 5, Enu(10, 0, 0), STILL, True),
        (10.0, 3, Enu(10, 0, 0), STILL, True),  # of two over the pads that with the lower id
        (10.0, 5, Enu(10, 0, 0), STILL, False),
        (15.0, 5, Enu(10, 0, 0), STILL, False),
        (15.1, 5, Enu(10, 0, 0), STILL, True),
        (60.0, 3, Enu(0, 80, 0), STILL, True),  # who waits with a lower id goes first
        (60.0, 3, Enu(0, 80.1, 0), STILL, False),
        (60.0, 5, Enu(0, 80, 0), STILL, False),
        (10.0, 3, Enu(0, 80, 0), STILL, False),
        (60.0, 5, Enu(0, 0, -3.1), Enu(0, 0, -0.7), False),  # the one before has sunk
        (60.0, 5, Enu(0, 0, -3.0), Enu(0, 0, -0.7), True),
        (60.0, 5, Enu(0, 0, -20), Enu(0, 0, -0.69), True),  # is on its way up, or stands
        (60.0, 5, Enu(0, 0, -25), STILL, True),
        (60.0, 5, Enu(0, 0, -25.1), STILL, False),  # stands at home
    ],
)
def test_a_uav_waits_beside_its_pad_for_the_turn_of_others(
    make_scenario: MakeScenario, here_m: float, other: int, off: Enu, velocity: Enu, waits: bool
) -> None:
    one = Alone(make_scenario, beside=frozenset({other}))
    found = one.off_home_m(0.6 * here_m, -0.8 * here_m, **{f"n{other}": (off, velocity)})
    assert found == pytest.approx(40.0 if waits else 0.0)
    if waits:
        assert one.back.goal(0).minus(Enu(HOME.east + 24, HOME.north - 32, HOME.up)).norm() < 1e-6, "on its side"


def test_who_waits_over_its_own_pad_flies_aside_and_does_not_land(make_scenario: MakeScenario) -> None:
    one = Alone(make_scenario, beside=frozenset({3}))
    assert one.off_home_m(0.0, 0.9, n3=(Enu(5, 0, 0), STILL)) == pytest.approx(40.0)
    assert not one.lands(0.0, 0.9)


def test_for_those_whose_pads_are_elsewhere_nobody_waits(make_scenario: MakeScenario) -> None:
    assert Alone(make_scenario).off_home_m(60.0, 0.0, n3=(Enu(5, 0, 0), STILL)) == 0.0
