"""Persons, not phones: who is certainly there is reported once, also without a phone, and no false alarm is."""

import math
import random
from collections.abc import Callable

import pytest
from seeing_uav import MODEL, UP_M, Uav

from agents.mission.finding.announcing import Announcing
from agents.mission.finding.camera_view import CameraView, recognized_share
from agents.mission.finding.identities import Sighting
from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.phone_localization import Estimate
from agents.mission.outbox import Outbox
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, S
from fanet_mw.wire.survivors import Found, Standing, is_person, person_id
from sim.world.sensors.camera import recognized_share as recognized_by_the_world

MakeScenario = Callable[..., Scenario]
PLACE = Estimate(0.0, 0.0, 1.0, 0.0, 1.0)


def see(uav: Uav, *people: Enu, second: float, north_m: float) -> None:
    uav.here = Enu(0, north_m, UP_M)
    uav.see(*people, now_ns=round(second * S))


def test_who_is_seen_twice_from_two_places_is_reported_although_no_phone_fits() -> None:
    for moved_m, reported in ((12.0, 1), (4.0, 0)):
        uav = Uav()
        see(uav, Enu(3, 4, 0), second=0, north_m=0)
        see(uav, Enu(3, 4, 0), second=2, north_m=moved_m)
        uav.hear(1, 1, Enu(0, 100, UP_M), -89.0)
        assert uav.identities.unreported(5 * S) == [], "the phone may still fit"
        uav.identities.review(6 * S)
        assert len(uav.identities.unreported(6 * S)) == reported


def test_who_is_seen_where_no_phone_is_heard_is_reported_two_seconds_later() -> None:
    uav = Uav()
    see(uav, Enu(3, 4, 0), second=0, north_m=0)
    see(uav, Enu(3, 4, 0), second=2, north_m=12)
    assert uav.identities.unreported(4 * S - 1) == []
    assert len(uav.identities.unreported(4 * S)) == 1


@pytest.mark.parametrize(("apart_m", "sigma_m", "proven"), [(16.0, 4.8, False), (2.0, 1.0, True)])
def test_false_alarms_that_stand_apart_at_the_edge_of_the_image_are_nobody(
    apart_m: float, sigma_m: float, proven: bool
) -> None:
    """A thousand an hour once made a person of three, 13 to 21 m apart, of 6.4 of evidence each."""
    uav = Uav()
    for second, (east, north) in enumerate(((0.0, 0.0), (-0.5, 0.8), (-0.6, -0.4))):
        sighting = Sighting(Enu(60 + apart_m * east, apart_m * north, 0), sigma_m, close=True)
        uav.identities.on_reading([sighting], here=Enu(0, 20.0 * second, 77), evidence=6.4, now_ns=second * S)
    uav.identities.review(3 * S)
    assert len(uav.identities.unreported(8 * S)) == proven


def test_of_whom_there_is_a_find_nobody_reports_again() -> None:
    for found in (Found(0, 1, 2.0, 4.0, 1.0, 0.0, 1.0, 9, Standing.CONFIRMED), told_person(9, 2.0, 4.0)):
        uav = Uav()
        uav.survivors.on_found(found, now_ns=0)
        for second in range(9):
            see(uav, Enu(3, 4, 0), second=second, north_m=7.5 * second)
        assert uav.identities.unreported(9 * S) == []
        other = Uav()
        other.survivors.on_found(found._replace(east_m=40.0), now_ns=0)
        for second in range(9):
            see(other, Enu(3, 4, 0), second=second, north_m=7.5 * second)
        assert len(other.identities.unreported(9 * S)) == 1


@pytest.mark.parametrize(("together", "reported"), [(False, 0), (True, 1)])
def test_beside_who_is_found_a_second_person_is_one_whom_images_show_together_with_the_first(
    together: bool, reported: int
) -> None:
    """Of a thousand false alarms an hour some once became a second person, 9 m beside the first."""
    uav, found, beside = Uav(), Enu(0, 4, 0), Enu(11.5, 4, 0)
    uav.survivors.on_found(told_person(9, 0.0, 4.0), now_ns=0)
    for second in range(16):
        shown = (found,) if second < 8 else (found, beside) if together else (beside,)
        see(uav, *shown, second=second, north_m=7.5 * second)
    assert len(uav.identities.unreported(16 * S)) == reported


@pytest.mark.parametrize(
    ("find_m", "others_m", "reported"), [(15.0, (), 0), (15.0, (15.0,), 1), (21.0, (), 1), (15.0, (-15.0,), 2)]
)
def test_who_is_seen_alone_is_of_a_find_a_little_farther_away(
    find_m: float, others_m: tuple[float, ...], reported: int
) -> None:
    uav = Uav()
    uav.survivors.on_found(told_person(9, find_m, 4.0)._replace(east_variance_m2=8, north_variance_m2=8), now_ns=0)
    for second in range(9):
        see(uav, *(Enu(east_m, 4, 0) for east_m in (0, *others_m)), second=second, north_m=7.5 * second)
    assert len(uav.identities.unreported(9 * S)) == reported


def test_fifteen_people_within_80_m_are_fifteen_each_within_a_metre() -> None:
    draw = random.Random("crowd")
    truth = [Enu(draw.uniform(-40, 40), draw.uniform(-40, 40), 0) for _ in range(15)]
    uav = Uav()
    for image in range(60):
        shown = [Enu(at.east + draw.gauss(0, 1.2), at.north + draw.gauss(0, 1.2), 0) for at in truth]
        sightings = [Sighting(at, 2.0, close=True) for at in shown if draw.random() < 0.9]
        people = uav.identities.on_reading(sightings, here=Enu(0, image, UP_M), evidence=9.0, now_ns=image * S // 2)
        uav.identities.on_images(1, lambda _: True, evidence=math.log(0.3), but=people)
        uav.identities.review(image * S // 2)
    found = uav.identities.unreported(30 * S)
    assert len(found) == 15
    assert sum(min(place.distance_m(at) for at in truth) for place in found) / 15 < 1.0


@pytest.mark.parametrize("per_hour", [100.0, 1000.0])
def test_false_alarms_are_nobody(make_scenario: MakeScenario, per_hour: float) -> None:
    scenario = make_scenario(
        **{"sensors.camera_hz": 2.0, "sensors.camera_fov_deg": 90.0, "sensors.camera_false_per_hour": per_hour}
    )
    view, draw, uav, reported = CameraView(scenario), random.Random("alarms"), Uav(), 0
    for image in range(6000):  # 50 minutes
        here = Enu(0, 3.75 * image % 400, UP_M)
        count = sum(draw.random() < per_hour / 7200 / 4 for _ in range(4))
        alarms = [Enu(draw.uniform(-65, 65), here.north + draw.uniform(-36, 36), 0) for _ in range(count)]
        now_ns = image * S // 2
        shown = uav.identities.on_reading(
            [Sighting(at, 2.0, close=True) for at in alarms],
            here=here,
            evidence=view.sighting_evidence(UP_M),
            now_ns=now_ns,
        )
        uav.identities.on_images(
            1, lambda place, here=here: view.shows(place, here), evidence=view.empty_evidence(UP_M), but=shown
        )
        uav.identities.review(now_ns)
        reported += len(uav.identities.unreported(now_ns))
    assert reported == 0


def test_a_person_is_seen_in_spite_of_false_alarms(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(
        **{"sensors.camera_hz": 2.0, "sensors.camera_fov_deg": 90.0, "sensors.camera_false_per_hour": 1000.0}
    )
    view, uav = CameraView(scenario), Uav()
    for image in range(20):
        here = Enu(0, -36 + 3.75 * image, UP_M)
        sightings = [Sighting(Enu(0, 0, 0), 2.0, close=True)]
        uav.identities.on_reading(sightings, here=here, evidence=view.sighting_evidence(UP_M), now_ns=image * S // 2)
        uav.identities.review(image * S // 2)
    assert len(uav.identities.unreported(10 * S)) == 1


def test_on_board_a_camera_is_known_as_the_world_has_it() -> None:
    for pixels in (2.0, 7.0, 30.0):
        assert recognized_share(pixels, cycles_for_half=4.0) == pytest.approx(
            float(recognized_by_the_world(pixels, cycles_for_half=4.0))
        )


def told_person(node: int, east_m: float, north_m: float, *, number: int = 0) -> Found:
    return Found(0, person_id(node, number), east_m, north_m, 1.0, 0.0, 1.0, node, Standing.CONFIRMED)


def test_of_two_who_found_one_person_the_one_with_the_lower_id_keeps_the_find_and_two_people_stay_two() -> None:
    survivors, outbox = KnownSurvivors(MODEL), Outbox()
    announcing = Announcing(NodeId(7), survivors, outbox)
    announcing.report_person(PLACE, 0)
    announcing.report_person(PLACE._replace(east_m=3.0), 0)
    survivors.on_found(told_person(3, 0.5, 0.5), now_ns=S)
    survivors.on_found(told_person(9, 3.0, 0.0), now_ns=S)
    for _ in range(3):
        announcing.give_up_doubles(2 * S, steady_m2=1.0)
    assert sorted(survivors.person_places()) == [person_id(3, 0), person_id(7, 1), person_id(9, 0)]
    assert not survivors.on_found(told_person(7, 0.0, 0.0), now_ns=3 * S), "what was given up does not come back"


def test_who_was_taken_for_another_is_a_person_all_the_same() -> None:
    survivors = KnownSurvivors(MODEL)
    announcing = Announcing(NodeId(7), survivors, Outbox())
    survivors.on_found(Found(0, 1, 2.0, 4.0, 1.0, 0.0, 1.0, 9, Standing.CONFIRMED), now_ns=0)
    for _ in range(2):
        announcing.keep_person(1, S, steady_m2=1.0)
    places = list(survivors.person_places().values())
    assert [(place.east_m, place.north_m) for place in places] == [(2.0, 4.0)]
    assert all(is_person(number) for number in survivors.persons)


def test_a_place_that_was_taken_back_is_doubted_for_half_a_minute() -> None:
    survivors = KnownSurvivors(MODEL)
    mistaken = Found(10_000_000, 1, 0.0, 0.0, 1.0, 0.0, 1.0, 9, Standing.REFUTED)
    survivors.on_found(mistaken, now_ns=10 * S)
    known = survivors.by_id[1]
    assert known.was_mistaken_at(Enu(5, 0, 0), since_ns=10 * S)
    assert not known.was_mistaken_at(Enu(5, 0, 0), since_ns=11 * S)


def test_an_image_is_as_wide_as_the_field_of_view_and_not_as_high(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"sensors.camera_hz": 2.0, "sensors.camera_fov_deg": 90.0})
    view = CameraView(scenario)
    assert view.shows(Enu(55, 30, 0), Enu(0, 0, UP_M))
    assert not view.shows(Enu(62, 0, 0), Enu(0, 0, UP_M))
    assert not view.shows(Enu(0, 35, 0), Enu(0, 0, UP_M)), "images are wider than high"
    assert not view.shows(Enu(55, 0, 20), Enu(0, 0, UP_M)), "uphill an image ends earlier"
    assert view.shows(Enu(62, 0, -20), Enu(0, 0, UP_M))
