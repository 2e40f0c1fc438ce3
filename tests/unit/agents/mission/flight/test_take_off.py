"""When a UAV that stands on its pad is sent up, and when it has taken off: timelines of its fixes."""

from collections.abc import Mapping

import pytest

from agents.mission.flight.take_off import TakeOff, take_off_ns, turns_ns
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.onboard_map import NO_MAP
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from fanet_mw.motion import Motion
from fanet_mw.units import MS, STILL, Enu, NodeId, S

PAD = Enu(100.0, -900.0, 20.0)
HEIGHT_M = 60.0


class Pad:
    """The UAV 5 on its pad, its clock, and the courses that it has commanded."""

    def __init__(self) -> None:
        self.own_motion = OwnMotion(PAD, KnownObstacles(NO_MAP))
        self.neighbors, self.outbox = NeighborMotions(), Outbox()
        self.take_off = TakeOff(
            NodeId(5), PAD,
            own_motion=self.own_motion, neighbors=self.neighbors, outbox=self.outbox, height_m=HEIGHT_M,
        )  # fmt: skip
        self.up_m, self.now_ns = PAD.up, 0
        self.told_s: list[float] = []
        """The instants at which the take-off was commanded."""

    def wait(
        self, seconds: float, *, climb_m_s: float = 0.0, beside: Mapping[int, tuple[float, float]] | None = None
    ) -> "Pad":
        """Fixes five times a second; `beside` has the distance to the east and the height above the pad of others."""
        for _ in range(round(5 * seconds)):
            for node, (east_m, above_m) in (beside or {}).items():
                place = Enu(PAD.east + east_m, PAD.north, PAD.up + above_m)
                self.neighbors.on_hello(node, Motion(place, STILL, self.now_ns))
            self.up_m += 0.2 * climb_m_s
            self.own_motion.fix(PAD._replace(up=self.up_m), Enu(0.0, 0.0, climb_m_s), now_ns=self.now_ns)
            self.take_off.fix(self.now_ns)
            course, self.outbox.course = self.outbox.course, None
            if course is not None:
                assert course.take_off
                assert course.position == PAD._replace(up=PAD.up + HEIGHT_M)
                self.told_s.append(self.now_ns / S)
            self.now_ns += 200 * MS
        return self


def test_it_listens_and_then_climbs_until_it_is_nearly_as_high_as_the_lanes() -> None:
    pad = Pad().wait(4)
    assert pad.told_s == [3.0]
    pad.wait(20, climb_m_s=2.5)
    assert pad.take_off.lasts
    pad.wait(3, climb_m_s=2.5)
    assert not pad.take_off.lasts
    assert pad.told_s == [3.0], "a UAV that climbs is not told again"
    assert pad.now_ns == pytest.approx(take_off_ns(HEIGHT_M), abs=2 * S)


def test_a_uav_that_is_up_when_its_program_begins_does_not_take_where_it_is_for_its_pad() -> None:
    pad = Pad()
    pad.up_m = PAD.up + 0.95 * HEIGHT_M
    pad.wait(0.2)
    assert (pad.take_off.stands, pad.take_off.lasts, pad.told_s) == (False, False, [])


def test_a_lost_setpoint_is_sent_again() -> None:
    pad = Pad().wait(7.5)
    assert pad.told_s == [3.0, 5.0, 7.0]


def test_a_uav_whose_altitude_is_measured_too_low_has_taken_off_when_it_climbs_no_more() -> None:
    pad = Pad().wait(4).wait(20, climb_m_s=2.4).wait(1)
    assert pad.up_m < PAD.up + 0.9 * HEIGHT_M
    assert not pad.take_off.lasts


@pytest.mark.parametrize(
    ("beside", "waits"),
    [
        ({4: (8.0, 0.0)}, True),
        ({4: (8.0, 12.0)}, True),
        ({4: (8.0, 18.0)}, False),
        ({4: (12.0, 0.0)}, False),
        ({6: (8.0, 0.0)}, False),
    ],
    ids=["on the next pad", "low above the next pad", "well above", "far enough aside", "comes after this one"],
)
def test_who_stands_too_near_to_one_with_a_lower_id_waits_until_that_one_has_climbed(
    beside: Mapping[int, tuple[float, float]], waits: bool
) -> None:
    pad = Pad().wait(10, beside=beside)
    assert (not pad.told_s) == waits


def test_a_neighbor_that_never_leaves_its_pad_holds_nobody_up_for_good() -> None:
    pad = Pad().wait(50, beside={4: (8.0, 0.0)})
    assert pad.told_s[0] == 40.0


@pytest.mark.parametrize(("apart_m", "turns_s"), [(15, 0), (6, 24), (3, 24)])
def test_the_take_off_of_four_lasts_longer_by_their_turns_if_they_stand_beside_each_other(
    apart_m: float, turns_s: float
) -> None:
    pads = {node: Enu(apart_m * node, 0.0, 0.1) for node in range(1, 5)}
    assert turns_ns(pads) == turns_s * S
    assert turns_ns({}) == 0
