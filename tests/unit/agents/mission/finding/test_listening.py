"""When a UAV reports a phone, and which places without reception it notes: its own, others', earlier ones."""

import pytest
from kit import MakeScenario
from seeing_uav import MODEL

from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.phone_localization import PhoneFilter
from agents.mission.finding.phone_reception import PhoneReception
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.onboard_map import NO_MAP
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from fanet_mw.motion import Motion
from fanet_mw.trace import Detected
from fanet_mw.units import STILL, US, Enu, NodeId, S
from fanet_mw.wire.search_messages import told_in
from fanet_mw.wire.survivors import Found, Standing, Survivor

HERE = Enu(10.0, -20.0, 60.0)
MS = S // 1000


class Listener:
    """A UAV that listens every two seconds, and the places without reception that its filters have been told."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, make_scenario: MakeScenario) -> None:
        scenario = make_scenario(**{"mission.scan_interval_s": 2.0, "mission.report_interval_s": 5.0})
        self.silent: list[Enu] = []
        monkeypatch.setattr(PhoneFilter, "on_silence", lambda _, at: self.silent.append(at))
        self.survivors, self.neighbors, self.out = (
            KnownSurvivors(MODEL),
            NeighborMotions(hello_interval_s=9.0),
            Outbox(),
        )
        self.motion = OwnMotion(HERE, KnownObstacles(NO_MAP))
        self.reception = PhoneReception(scenario, NodeId(8), self.survivors, self.motion, self.out, self.neighbors)

    def told(self) -> list[Enu]:
        silent, self.silent[:] = list(self.silent), []
        return silent

    def reports(self) -> list[Survivor]:
        frames = [packet.frames for packet in self.out.packets]
        self.out.packets.clear()
        return [one for packed in frames for one in told_in(bytes(36) + packed) if isinstance(one, Survivor)]


@pytest.fixture
def uav(monkeypatch: pytest.MonkeyPatch, make_scenario: MakeScenario) -> Listener:
    return Listener(monkeypatch, make_scenario)


def test_a_phone_is_reported_at_once_and_then_at_intervals_until_it_is_confirmed(uav: Listener) -> None:
    for now_ns, reported in ((S, True), (6 * S - 1, False), (6 * S, True), (9 * S, False), (11 * S, True)):
        uav.reception.scan([(3, -70.125)], now_ns=now_ns)
        assert uav.reports() == ([Survivor(now_ns // US, 3, 8, HERE, -70.125)] if reported else []), now_ns
    uav.survivors.on_found(Found(0, 3, 0, 0, 4, 0, 4, 5, Standing.CONFIRMED), now_ns=12 * S)
    uav.reception.scan([(3, -70.125)], now_ns=30 * S)
    assert uav.reports() == []


def test_the_first_reception_of_each_phone_by_this_uav_is_recorded(uav: Listener) -> None:
    uav.survivors.take_report(Survivor(0, 3, 5, HERE, -60.0), now_ns=0)
    for second in (1, 2):
        uav.reception.scan([(3, -70.126), (4, -81.0)], now_ns=second * S)
    assert uav.out.records == [Detected(S, NodeId(8), 3, -70.13), Detected(S, NodeId(8), 4, -81.0)]


def test_a_scan_rules_out_this_place_for_every_unconfirmed_phone_that_it_does_not_show(uav: Listener) -> None:
    for survivor in (3, 4, 5, 6):
        uav.survivors.take_report(Survivor(0, survivor, 2, HERE, -60.0), now_ns=0)
    uav.survivors.on_found(Found(0, 6, 0, 0, 4, 0, 4, 5, Standing.CONFIRMED), now_ns=0)
    uav.reception.scan([(4, -70.0)], now_ns=S)
    assert uav.told() == [HERE, HERE]


def test_after_one_and_a_half_intervals_without_a_scan_none_is_assumed_to_have_shown_a_phone(uav: Listener) -> None:
    uav.survivors.take_report(Survivor(0, 3, 2, HERE, -60.0), now_ns=0)
    uav.reception.scan([], now_ns=10 * S)
    uav.told()
    uav.reception.review(13 * S)
    assert HERE not in uav.told()
    uav.reception.review(13 * S + 1)
    assert uav.told() == [HERE]
    uav.reception.review(16 * S + 1)
    assert uav.told() == [], "the assumed one counts as a scan"


def test_neighbors_that_report_nothing_receive_nothing_while_a_phone_is_hardly_placed(uav: Listener) -> None:
    there = Enu(200.0, 0.0, 60.0)

    def noted(*, first_s: float = 0.0, reported_s: float | None = None, powers: int = 1, away_m: float = 0.0) -> bool:
        uav.survivors.by_id.clear()
        uav.motion.position = HERE
        for count in range(powers):
            at = Enu(10.0 + away_m, -20.0 + 40 * count, 60.0)
            uav.survivors.take_report(Survivor(0, 3, 5, at, -60.0), now_ns=round(first_s * S))
        if reported_s is not None:
            uav.survivors.take_report(Survivor(round(reported_s * S) // US, 3, 2, there, -60.0), now_ns=0)
        uav.told()
        uav.reception._note_silent_neighbors(20 * S)
        return there in uav.told()

    uav.neighbors.on_hello(2, Motion(there, STILL, 19 * S))
    assert noted()
    assert noted(first_s=16.99)
    assert not noted(first_s=17.0), "it has only just been received at all"
    assert noted(reported_s=12.99)
    assert not noted(reported_s=13.0), "who reported it within 7 s receives it"
    assert noted(powers=11)
    assert not noted(powers=12), "its powers place it"
    assert noted(away_m=450.0)
    assert not noted(away_m=450.1), "it concerns others"


def test_neighbors_are_looked_at_every_three_seconds(uav: Listener) -> None:
    uav.survivors.take_report(Survivor(0, 3, 5, HERE, -60.0), now_ns=0)
    there = Enu(200.0, 0.0, 60.0)
    uav.reception.scan([(3, -60.0)], now_ns=10 * S)
    for now_ns, looked in ((10 * S, True), (13 * S - 1, False), (13 * S, True)):
        uav.neighbors.on_hello(2, Motion(there, STILL, now_ns))
        uav.told()
        uav.reception.scan([(3, -60.0)], now_ns=now_ns)
        uav.reception.review(now_ns)
        assert (there in uav.told()) is looked, now_ns


def test_where_somebody_listened_before_a_phone_was_received_is_recalled_once(uav: Listener) -> None:
    first, beside, later = Enu(100.0, 0.0, 60.0), Enu(300.0, 0.0, 60.0), Enu(500.0, 0.0, 60.0)
    uav.motion.position = first
    uav.neighbors.on_hello(2, Motion(beside, STILL, 9 * S))
    uav.reception.scan([], now_ns=10 * S)
    uav.reception.review(10 * S)
    uav.motion.position = later
    uav.neighbors.on_hello(2, Motion(Enu(800.0, 0.0, 60.0), STILL, 13 * S))
    uav.reception.scan([], now_ns=14 * S - 1)
    uav.reception.review(14 * S - 1)
    uav.motion.position = HERE
    uav.reception.scan([(3, -80.0)], now_ns=17 * S - 2)
    uav.told()
    uav.reception.review(17 * S - 2)
    assert uav.told()[:2] == [first, beside], "and not where it was less than three seconds ago"
    assert later not in uav.told()
    uav.reception.review(17 * S)
    assert first not in uav.told(), "once"


def test_of_each_cell_of_50_m_the_newest_place_is_recalled_for_a_minute(uav: Listener) -> None:
    places = {0: Enu(100.0, 0.0, 60.0), 3: Enu(300.0, 0.0, 60.0), 6: Enu(100.0, 0.0, 61.0), 9: Enu(300.0, 26.0, 60.0)}
    for second, at in places.items():
        uav.motion.position = at
        uav.reception._note_listeners(second * S)
    listened = uav.reception._listened
    assert sorted(listened.values()) == [(3 * S, places[3]), (6 * S, places[6]), (9 * S, places[9])]
    uav.motion.position = Enu(-400.0, 0.0, 60.0)
    uav.reception._note_listeners(63 * S)
    assert (3 * S, places[3]) in listened.values()
    uav.reception._note_listeners(63 * S + 1)
    assert (3 * S, places[3]) not in listened.values()
