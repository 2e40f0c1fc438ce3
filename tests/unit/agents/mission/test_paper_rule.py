"""The mission of one UAV by the paper's rule, as timelines."""

from typing import Any

import pytest

from agents.mission.flight.approach_speed import approach_speed_m_s
from agents.mission.outbox import Outbox
from agents.mission.paper_rule import PaperRule
from fanet_mw.application import HOME
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario, config
from fanet_mw.trace import Approaching, Arrived, Detected
from fanet_mw.units import Enu, NodeId, S
from fanet_mw.wire import HEADER_BYTES, PRIORITY_REPORT
from fanet_mw.wire.survivors import Survivor

HERE = Enu(0, 0, 50)
KEYS: dict[str, Any] = {
    "survivors": 9, "reports_to_approach": 3, "report_interval_s": 5, "dwell_s": 10, "arrival_m": 30,
}  # fmt: skip


def scenario(**mission: Any) -> Scenario:
    return config.build({"nodes": {"count": 9}, "clusters": {"count": 1}, "mission": {**KEYS, **mission}})


CONFIG = scenario().mission


def report(survivor: int, reporter: int, east: float, north: float = 0.0, rssi_dbm: float = -80.0) -> Survivor:
    return Survivor(0, survivor, reporter, Enu(east, north, 50), rssi_dbm)


class Uav:
    """A rule and what it puts out."""

    def __init__(self, **mission: Any) -> None:
        self.out = Outbox()
        self.rule = PaperRule(scenario(**mission), NodeId(1), self.out)

    @property
    def speed_m_s(self) -> float | None:
        """Of the course that is to be flown; None without one."""
        return None if self.out.course is None else self.out.course.speed_m_s

    @property
    def reported_us(self) -> list[int]:
        return [Survivor.decode_frame(bytes(HEADER_BYTES) + packet.frames).t_us for packet in self.out.packets]


def test_a_phone_is_detected_once_and_reported_again_only_after_the_interval() -> None:
    uav = Uav()
    for second in range(7):
        uav.rule.scan(((4, -70.0),), position=HERE, now_ns=second * S)
    assert [r for r in uav.out.records if isinstance(r, Detected)] == [Detected(0, 1, 4, -70.0)]
    assert uav.reported_us == [0, 5_000_000]


def test_a_phone_is_reported_more_often_than_it_is_measured_until_a_scan_no_longer_has_it() -> None:
    uav = Uav(report_interval_s=0.1)
    uav.rule.scan(((4, -70.0),), position=HERE, now_ns=0)
    while (due_ns := uav.rule.next_wake_ns()) is not None:
        uav.rule.wake(due_ns)
    assert len(uav.out.packets) == 16, "the receiver looks every second: after 1.5 s of silence the phone is gone"


def test_a_report_is_filled_up_to_its_length_and_urgent() -> None:
    short, long = Uav(), Uav(report_bytes=512)
    for uav in (short, long):
        uav.rule.scan(((4, -70.0),), position=HERE, now_ns=0)
    assert [len(packet.frames) + HEADER_BYTES for packet in (*short.out.packets, *long.out.packets)] == [79, 512]
    assert [packet.priority for packet in (*short.out.packets, *long.out.packets)] == 2 * [PRIORITY_REPORT]
    assert long.reported_us == [0]


def test_each_uav_approaches_at_a_speed_of_its_own_between_the_bounds() -> None:
    speeds = [approach_speed_m_s(scenario(approach_speed_m_s=(5, 10)), NodeId(node)) for node in range(1, 10)]
    assert len(set(speeds)) == 9
    assert 5 <= min(speeds) < 7 < 8 < max(speeds) <= 10


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"report_bytes": 80}, "mission.report_bytes = 80 must be 0 or >= 96"),
        ({"approach_speed_m_s": (10, 5)}, "must be [least, greatest]"),
    ],
)
def test_a_report_without_room_and_bounds_in_the_wrong_order_are_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError) as refused:
        scenario(**wrong)
    assert message in str(refused.value)


def test_two_reporters_are_not_enough_and_one_who_repeats_itself_counts_once() -> None:
    uav = Uav()
    for reporter in (2, 3, 3, 2, 3):
        uav.rule.reported(report(4, reporter, 100), position=HERE, now_ns=S)
    assert uav.out.course is None


def test_the_third_reporter_changes_the_course() -> None:
    uav = Uav()
    for reporter, east in ((2, 200), (3, 250), (5, 300)):
        uav.rule.reported(report(4, reporter, east), position=HERE, now_ns=S)
    assert uav.speed_m_s == CONFIG.approach_speed_m_s
    (record,) = [r for r in uav.out.records if isinstance(r, Approaching)]
    assert (record.survivor, record.reporters) == (4, 3)


def test_of_two_known_survivors_the_nearer_one_is_approached_then_the_other_then_home() -> None:
    uav = Uav()
    for survivor, east in ((2, 0), (7, 900), (4, 100)):  # 2 is approached at once, the others when it has been visited
        for reporter in (2, 3, 5):
            uav.rule.reported(report(survivor, reporter, east + reporter), position=HERE, now_ns=S)
    now_ns = S
    for _ in range(3):
        approached = [r for r in uav.out.records if isinstance(r, Approaching)][-1]
        at = Enu(approached.east_m, approached.north_m, 50)
        uav.rule.moved(at, now_ns=now_ns)
        now_ns += 11 * S
        uav.rule.moved(at, now_ns=now_ns)
    assert [r.survivor for r in uav.out.records if isinstance(r, Arrived)] == [2, 4, 7]
    assert uav.speed_m_s == HOME


def approaching(*reports: Survivor) -> Uav:
    """A mission that has heard of survivor 4 by these, and whose course has been taken."""
    uav = Uav()
    for one in reports:
        uav.rule.reported(one, position=HERE, now_ns=S)
    uav.out.course = None
    return uav


NEAR = [report(4, reporter, east) for reporter, east in ((2, 100), (3, 120), (5, 140))]


def test_of_one_reporter_the_strongest_report_counts_whichever_comes_last() -> None:
    weaker = report(4, 2, 900, rssi_dbm=-90.0)
    for reports in ([NEAR[0], weaker, *NEAR[1:]], [weaker, *NEAR]):
        (record,) = [r for r in approaching(*reports).out.records if isinstance(r, Approaching)]
        assert 90 < record.east_m < 150


def test_a_uav_that_has_arrived_stays_for_its_time_and_then_flies_home() -> None:
    uav = approaching(*NEAR)
    at = Enu(120.0, 0.0, 50.0)
    for second, leaves in ((10, False), (11, False), (19, False), (20, True)):
        uav.rule.moved(at, now_ns=second * S)
        assert (uav.speed_m_s == HOME) == leaves


def test_a_better_estimate_turns_a_uav_only_when_it_is_far_off() -> None:
    uav = approaching(*NEAR)
    uav.rule.reported(report(4, 5, 140, rssi_dbm=-79.99), position=HERE, now_ns=2 * S)
    assert uav.out.course is None
    uav.rule.reported(report(4, 5, 600, rssi_dbm=-40.0), position=HERE, now_ns=3 * S)
    assert uav.out.course is not None


def test_uavs_that_turn_towards_one_survivor_hold_at_places_apart() -> None:
    places = []
    for node in range(1, 46):
        out = Outbox()
        rule = PaperRule(scenario(), NodeId(node), out)
        for reporter in (1, 2, 3):
            rule.reported(report(4, reporter, 100, 10.0 * reporter), position=HERE, now_ns=S)
        assert out.course is not None
        places.append(out.course.position)
    assert min(a.minus(b).norm() for i, a in enumerate(places) for b in places[:i]) > 1.6
