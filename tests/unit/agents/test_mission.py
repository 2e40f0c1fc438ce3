"""The mission of one UAV, as timelines."""

from agents.mission.everyone import Mission
from fanet_mw.application import HOME
from fanet_mw.scenario import Mission as Config
from fanet_mw.trace import Approaching, Arrived, Detected
from fanet_mw.units import Enu, NodeId, S
from fanet_mw.wire.inner import Survivor

HERE = Enu(0, 0, 50)
CONFIG = Config(survivors=9, reports_to_approach=3, report_interval_s=5, dwell_s=10, arrival_m=30)


def report(survivor: int, reporter: int, east: float, north: float = 0.0, rssi_dbm: float = -80.0) -> Survivor:
    return Survivor(0, survivor, reporter, Enu(east, north, 50), rssi_dbm)


def mission() -> Mission:
    return Mission(NodeId(1), CONFIG, altitude_m=50)


def test_a_phone_is_detected_once_and_reported_again_only_after_the_interval() -> None:
    uav = mission()
    for second in range(7):
        uav.scan(((4, -70.0),), position=HERE, now_ns=second * S)
    assert [r for r in uav.records if isinstance(r, Detected)] == [Detected(0, 1, 4, -70.0)]
    assert [r.t_us for r in uav.reports] == [0, 5_000_000]


def test_two_reporters_are_not_enough_and_one_who_repeats_itself_counts_once() -> None:
    uav = mission()
    for reporter in (2, 3, 3, 2, 3):
        uav.reported(report(4, reporter, 100), position=HERE, now_ns=S)
    assert uav.course is None


def test_the_third_reporter_changes_the_course() -> None:
    uav = mission()
    for reporter, east in ((2, 200), (3, 250), (5, 300)):
        uav.reported(report(4, reporter, east), position=HERE, now_ns=S)
    assert uav.course is not None
    assert uav.course.speed_m_s == CONFIG.approach_speed_m_s
    (record,) = [r for r in uav.records if isinstance(r, Approaching)]
    assert (record.survivor, record.reporters) == (4, 3)


def test_of_two_known_survivors_the_nearer_one_is_approached_then_the_other_then_home() -> None:
    uav = mission()
    for survivor, east in ((2, 0), (7, 900), (4, 100)):  # 2 is approached at once, the others when it has been visited
        for reporter in (2, 3, 5):
            uav.reported(report(survivor, reporter, east + reporter), position=HERE, now_ns=S)
    now_ns = S
    for _ in range(3):
        approached = [r for r in uav.records if isinstance(r, Approaching)][-1]
        at = Enu(approached.east_m, approached.north_m, 50)
        uav.moved(at, now_ns=now_ns)
        now_ns += 11 * S
        uav.moved(at, now_ns=now_ns)
    assert [r.survivor for r in uav.records if isinstance(r, Arrived)] == [2, 4, 7]
    assert uav.course is not None
    assert uav.course.speed_m_s == HOME


def approaching(*reports: Survivor) -> Mission:
    """A mission that has heard of survivor 4 by these, and whose course has been taken."""
    uav = mission()
    for one in reports:
        uav.reported(one, position=HERE, now_ns=S)
    uav.course = None
    return uav


NEAR = [report(4, reporter, east) for reporter, east in ((2, 100), (3, 120), (5, 140))]


def test_of_one_reporter_the_strongest_report_counts_whichever_comes_last() -> None:
    weaker = report(4, 2, 900, rssi_dbm=-90.0)
    for reports in ([NEAR[0], weaker, *NEAR[1:]], [weaker, *NEAR]):
        (record,) = [r for r in approaching(*reports).records if isinstance(r, Approaching)]
        assert 90 < record.east_m < 150


def test_a_uav_that_has_arrived_stays_for_its_time_and_then_flies_home() -> None:
    uav = approaching(*NEAR)
    at = Enu(120.0, 0.0, 50.0)
    for second, leaves in ((10, False), (11, False), (19, False), (20, True)):
        uav.moved(at, now_ns=second * S)
        assert (uav.course is not None and uav.course.speed_m_s == HOME) == leaves


def test_a_better_estimate_turns_a_uav_only_when_it_is_far_off() -> None:
    uav = approaching(*NEAR)
    uav.reported(report(4, 5, 140, rssi_dbm=-79.99), position=HERE, now_ns=2 * S)
    assert uav.course is None
    uav.reported(report(4, 5, 600, rssi_dbm=-40.0), position=HERE, now_ns=3 * S)
    assert uav.course is not None
