"""One person by sightings: where, how certainly, and for how long remembered."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.mission.finding.person_track import PersonTrack
from agents.mission.finding.phone_localization import Estimate
from fanet_mw.units import Enu, S

HERE = Enu(0, 0, 60)
metres = st.floats(-500, 500)
variances = st.floats(0.25, 400)


def seen_at(at: Enu, variance_m2: float, *, evidence: float = 9.0) -> PersonTrack:
    return PersonTrack(Estimate(at.east, at.north, variance_m2, 0.0, variance_m2), S, S, HERE, evidence)


@given(st.lists(st.tuples(metres, metres, variances), min_size=1, max_size=6))
def test_the_place_is_the_mean_of_all_sightings_weighted_by_their_certainty(
    sightings: list[tuple[float, float, float]],
) -> None:
    person = seen_at(Enu(*sightings[0][:2], 0), sightings[0][2])
    for east, north, variance_m2 in sightings[1:]:
        person.on_sighting(Enu(east, north, 0), variance_m2, here=HERE, evidence=1.0, now_ns=2 * S)
    total = math.fsum(1 / variance_m2 for *_, variance_m2 in sightings)
    place = person.place
    assert place.east_m == pytest.approx(math.fsum(e / v for e, _, v in sightings) / total, abs=1e-6)
    assert place.north_m == pytest.approx(math.fsum(n / v for _, n, v in sightings) / total, abs=1e-6)
    assert (place.east_variance_m2, place.covariance_m2, place.north_variance_m2) == pytest.approx(
        (1 / total, 0.0, 1 / total)
    )
    assert person.sightings == len(sightings)


def test_a_sighting_is_as_far_from_a_person_as_both_variances_say() -> None:
    person = seen_at(Enu(10, 20, 0), 9.0)
    assert person.distance2(Enu(13, 24, 0), 16.0) == pytest.approx(25.0 / 25.0)
    assert person.distance2(Enu(16, 28, 0), 91.0) == pytest.approx(100.0 / 100.0)


def test_the_base_of_the_sightings_is_the_greatest_level_distance_from_the_first_and_does_not_shrink() -> None:
    person = seen_at(Enu(0, 0, 0), 4.0)
    for here, base_m in ((Enu(0, 0, 90), 0.0), (Enu(3, 4, 60), 5.0), (Enu(0, 0, 60), 5.0), (Enu(0, -9, 10), 9.0)):
        person.on_sighting(Enu(0, 0, 0), 4.0, here=here, evidence=1.0, now_ns=S)
        assert person.base_m == base_m


def test_a_person_is_proven_by_evidence_of_18_in_at_least_two_sightings() -> None:
    once = seen_at(HERE, 4.0, evidence=30.0)
    assert not once.is_proven, "one image, however clear"
    for first, proven in ((9.0, True), (8.5, False)):
        twice = seen_at(HERE, 4.0, evidence=first)
        twice.on_sighting(HERE, 4.0, here=HERE, evidence=9.0, now_ns=2 * S)
        assert twice.is_proven is proven


def test_since_when_somebody_is_certainly_there_is_noted_once_from_two_places_8_m_apart() -> None:
    person = seen_at(Enu(0, 0, 0), 4.0, evidence=9.0)
    for now_s, north_m, since_s in ((2, 7.9, None), (3, 8.0, 3), (4, 30.0, 3)):
        person.on_sighting(Enu(0, 0, 0), 4.0, here=Enu(0, north_m, 60), evidence=9.0, now_ns=now_s * S)
        person.on_neighborhood(confirmed=0, now_ns=now_s * S)
        assert person.proven_ns == (None if since_s is None else since_s * S)
    unproven = seen_at(Enu(0, 0, 0), 4.0, evidence=9.0)
    unproven.on_sighting(Enu(0, 0, 0), 4.0, here=Enu(0, 30, 60), evidence=1.0, now_ns=S)
    unproven.on_neighborhood(confirmed=0, now_ns=S)
    assert unproven.proven_ns is None, "the places alone prove nobody"


def test_a_person_counts_as_seen_anew_when_the_first_survivor_is_confirmed_at_its_place() -> None:
    person = seen_at(Enu(0, 0, 0), 4.0)
    for now_s, confirmed, first_s in ((2, 0, 1), (3, 1, 3), (4, 2, 3), (5, 0, 3), (6, 1, 6)):
        person.on_neighborhood(confirmed=confirmed, now_ns=now_s * S)
        assert (person.first_ns, person.confirmed) == (first_s * S, confirmed)


def test_a_single_sighting_is_remembered_for_10_s_and_several_for_60_s_after_the_last() -> None:
    once, twice = seen_at(HERE, 4.0), seen_at(HERE, 4.0)
    twice.on_sighting(HERE, 4.0, here=HERE, evidence=9.0, now_ns=5 * S)
    for person, last_s in ((once, 11), (twice, 65)):
        assert person.is_remembered(last_s * S)
        assert not person.is_remembered(last_s * S + 1)


def test_empty_images_take_a_person_back_however_often_it_was_seen() -> None:
    person = seen_at(HERE, 4.0)
    for _ in range(100):
        person.on_sighting(HERE, 4.0, here=HERE, evidence=9.0, now_ns=S)
    for _ in range(46):
        person.evidence -= 1.0
        assert person.is_remembered(S)
    person.evidence -= 1.0
    assert not person.is_remembered(S), "40 at most, and -7 is enough"
