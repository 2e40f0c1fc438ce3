"""A UAV whose height is wrong learns that from people whom it sees from several places."""

import math
import random

import pytest
from seeing_uav import MODEL, UP_M

from agents.mission.finding.height_error import HeightError, Parallax
from agents.mission.finding.identities import Identities, Sighting
from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.phone_localization import Estimate
from fanet_mw.units import Enu, S

SIGMA_M, PIXEL_M = 4.0, 2.0


class Flight:
    """A UAV that flies past people, so much higher than it takes itself to be."""

    def __init__(self, error_m: float, *, seed: int = 1) -> None:
        self.error_m, self.draw = error_m, random.Random(seed)
        self.height = HeightError(SIGMA_M)
        self.identities = Identities(KnownSurvivors(MODEL), height_error=self.height)

    def pass_by(self, *people: Enu, since_s: int = 0, evidence: float = 9.0) -> list[Estimate]:
        """Fly by at 7.5 m/s, an image each half second; the people who are reported afterwards."""
        for image in range(24):
            here = Enu(0, -45 + 3.75 * image, UP_M)
            sightings = [Sighting(self.seen(at, here), PIXEL_M, close=True) for at in people]
            now_ns = since_s * S + image * S // 2
            self.identities.on_reading(sightings, here=here, evidence=evidence, now_ns=now_ns)
            self.identities.review(now_ns)
        return self.identities.unreported((since_s + 12) * S)

    def seen(self, at: Enu, here: Enu) -> Enu:
        share = here.up / (here.up + self.error_m)
        east_m, north_m = here.east + share * (at.east - here.east), here.north + share * (at.north - here.north)
        return Enu(east_m + self.draw.gauss(0, PIXEL_M), north_m + self.draw.gauss(0, PIXEL_M), 0)


@pytest.mark.parametrize("error_m", [-8.0, -3.0, 0.0, 5.5, 9.0])
def test_who_passes_by_somebody_knows_its_height_and_the_place(error_m: float) -> None:
    for seed in range(8):
        flight = Flight(error_m, seed=seed)
        (place,) = flight.pass_by(truth := Enu(40, 10, 0))
        sigma_m = math.sqrt(flight.height.variance_m2)
        assert sigma_m < 2.0
        assert abs(flight.height.m - error_m) < 3.5 * sigma_m
        assert place.distance_m(truth) < 3.0 * max(1.0, place.sigma_m)


def test_what_was_learned_from_one_person_corrects_all_others() -> None:
    flight = Flight(6.0)
    flight.pass_by(Enu(10, 5, 0))
    here = Enu(0, 200, UP_M)
    (person,) = flight.identities.on_reading(
        [Sighting(flight.seen(Enu(60, 200, 0), here), PIXEL_M, close=True)], here=here, evidence=9.0, now_ns=20 * S
    )
    assert abs(person.place.east_m - 60) < 4.0, "it was seen 5 m too near"


def test_where_nobody_was_seen_from_two_places_the_height_says_how_sure_a_place_is() -> None:
    flight = Flight(6.0)
    here = Enu(0, 0, UP_M)
    for second in range(3):
        (person,) = flight.identities.on_reading(
            [Sighting(flight.seen(Enu(60, 0, 0), here), PIXEL_M, close=True)],
            here=here,
            evidence=9.0,
            now_ns=second * S,
        )
    assert flight.height.variance_m2 == pytest.approx(SIGMA_M**2, rel=0.01)
    told = person.told(flight.height.variance_m2)
    assert told.east_variance_m2 > 12 > 2 > told.north_variance_m2, "along the line of sight"
    assert math.hypot(told.east_m - 60, told.north_m) < 3 * told.sigma_m


def test_what_was_learned_is_forgotten_as_the_error_changes() -> None:
    height = HeightError(SIGMA_M, tau_s=1800)
    height.learn(Parallax(weighted_m=6.0, weight=1.0))
    assert height.m == pytest.approx(6.0 * 16 / 17)
    assert height.variance_m2 == pytest.approx(16 / 17)
    for minute in range(1, 31):
        height.advance(minute * 60 * S)
    assert height.m == pytest.approx(6.0 * 16 / 17 / math.e)
    assert height.variance_m2 == pytest.approx(16 - (16 - 16 / 17) / math.e**2)
    height.advance(0)
    assert height.m == pytest.approx(6.0 * 16 / 17 / math.e), "time does not run backwards"


def test_false_alarms_tell_nothing_of_the_height() -> None:
    flight = Flight(0.0)
    for image in range(400):
        here = Enu(0, 7.5 * image, UP_M)
        alarm = Enu(flight.draw.uniform(-12, 12), here.north + flight.draw.uniform(-12, 12), 0)
        flight.identities.on_reading([Sighting(alarm, PIXEL_M, close=True)], here=here, evidence=0.5, now_ns=image * S)
        flight.identities.review(image * S)
    assert flight.height.variance_m2 == SIGMA_M**2


def test_a_uav_that_measures_its_height_learns_nothing_of_it() -> None:
    flight = Flight(0.0)
    flight.height = HeightError()
    flight.identities = Identities(KnownSurvivors(MODEL), height_error=flight.height)
    flight.pass_by(Enu(40, 10, 0))
    assert (flight.height.m, flight.height.variance_m2) == (0.0, 0.0)
