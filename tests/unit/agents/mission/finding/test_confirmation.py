"""When a survivor may be confirmed: enough sightings, enough received powers, and nobody else whose phone it may be."""

from types import SimpleNamespace
from typing import cast

import pytest
from seeing_uav import UP_M, Uav, mean_dbm

from agents.mission.finding.confirmation import is_confirmable, is_undecided, required_margin
from agents.mission.finding.identities import Sighting
from agents.mission.finding.known_survivors import KnownSurvivor
from agents.mission.finding.person_track import PersonTrack
from agents.mission.finding.phone_localization import Estimate, PhoneFilter
from fanet_mw.units import Enu, S
from fanet_mw.wire.survivors import Found, Standing


def test_few_powers_by_one_node_do_not_tell_whose_phone_it_is() -> None:
    uav = Uav()
    for count in range(8):
        assert uav.see(Enu(0, 0, 0), now_ns=count * S) == [], f"{count} powers by one node"
        at = Enu(13, -100 + 30 * count, UP_M)
        uav.hear(1, 9, at, mean_dbm(Enu(0, 0, 0), at))
    assert uav.see(Enu(0, 0, 0), now_ns=9 * S) == [1]


def test_the_powers_of_several_nodes_tell_sooner() -> None:
    uav = Uav()
    for node, east in ((1, 40), (2, -60)):
        for north in (-60, 0, 60):
            assert uav.see(Enu(2, 3, 0), now_ns=0) == []
            at = Enu(east, north, UP_M)
            uav.hear(1, node, at, mean_dbm(Enu(0, 0, 0), at))
    assert uav.see(Enu(2, 3, 0), now_ns=S) == [1]


def test_while_two_phones_fit_one_person_nobody_is_named_until_waiting_longer_is_of_no_use() -> None:
    uav = Uav()
    for survivor, east in ((1, 0.0), (2, 4.0)):
        for node in range(1, 5):
            for north in (-60, 0, 60):
                at = Enu(40.0 * node - 100, north, UP_M)
                uav.hear(survivor, node, at, mean_dbm(Enu(east, 0, 0), at))
    assert not any(uav.see(Enu(0, 0, 0), now_ns=second * S) for second in range(50))


@pytest.mark.parametrize(("second", "margin"), [(0, 9.0), (15, 9.0), (32.5, 5.5), (50, 2.0), (500, 2.0)])
def test_a_uav_is_content_with_less_certainty_the_longer_it_waits(second: float, margin: float) -> None:
    person = PersonTrack(Estimate(0, 0, 1, 0, 1), 7 * S, 8 * S, Enu(0, 0, 0), 9.0)
    phone = heard(powers=20, reporters=2)
    assert required_margin(person, phone, round((7 + second) * S)) == margin
    phone.settled = Found(0, 1, 0.0, 0.0, 900.0, 0.0, 900.0, 9, Standing.INSIDE)
    assert required_margin(person, phone, round((7 + second) * S)) == margin
    phone.settled = phone.settled._replace(standing=Standing.AMONG)
    assert required_margin(person, phone, round((7 + second) * S)) == 9.0, "nobody waits for that any more"


@pytest.mark.parametrize(("margin", "second", "undecided"), [(1.9, 30, True), (2.0, 30, False), (1.9, 29.9, False)])
def test_after_half_a_minute_below_the_least_margin_it_stays_open_whose_phone_it_is(
    margin: float, second: float, undecided: bool
) -> None:
    person = PersonTrack(Estimate(0, 0, 1, 0, 1), 7 * S, 8 * S, Enu(0, 0, 0), 9.0)
    assert is_undecided(person, margin, round((7 + second) * S)) is undecided


def test_only_a_person_seen_from_close_by_is_confirmed() -> None:
    uav = Uav()
    for node, east in ((1, 40), (2, -60)):
        for north in (-60, 0, 60):
            at = Enu(east, north, UP_M)
            uav.hear(1, node, at, mean_dbm(Enu(0, 0, 0), at))
    for second in range(10):
        call = Sighting(Enu(0, 0, 0), 2.0, close=False)
        uav.identities.on_reading([call], here=uav.here, evidence=9.0, now_ns=second * S)
        assert uav.identities.review(second * S) == []
    assert uav.see(Enu(0, 0, 0), now_ns=11 * S) == [], "once is not enough"
    assert uav.see(Enu(0, 0, 0), now_ns=12 * S) == [1]


def seen_often(*, close: int = 2, sigma_m: float = 3.5, evidence: float = 18.0) -> PersonTrack:
    place = Estimate(0.0, 0.0, sigma_m**2, 0.0, 1.0)
    return PersonTrack(place, 0, 0, Enu(0, 0, 60), evidence, sightings=2, close_sightings=close)


def heard(*, powers: int, reporters: int, sigma_m: float = 80.0) -> KnownSurvivor:
    place = Estimate(0.0, 0.0, sigma_m**2, 0.0, 1.0)
    received = SimpleNamespace(included_powers=powers, estimate_by_power=lambda: place)
    return KnownSurvivor(cast("PhoneFilter", received), set(range(reporters)))


@pytest.mark.parametrize(("reporters", "least"), [(1, 8), (2, 6), (5, 6)])
def test_six_powers_by_two_nodes_or_eight_by_one_are_enough(reporters: int, least: int) -> None:
    assert is_confirmable(seen_often(), heard(powers=least, reporters=reporters))
    assert not is_confirmable(seen_often(), heard(powers=least - 1, reporters=reporters))


def test_each_condition_of_a_confirmation_is_needed_and_holds_at_its_bound() -> None:
    phone = heard(powers=6, reporters=2)
    assert is_confirmable(seen_often(), phone)
    assert not is_confirmable(seen_often(close=1), phone), "seen from close by once only"
    assert not is_confirmable(seen_often(evidence=17.9), phone), "not proven"
    assert not is_confirmable(seen_often(sigma_m=3.51), phone), "the place of the person is vague"
    assert not is_confirmable(seen_often(), heard(powers=6, reporters=2, sigma_m=120.1)), "that of the phone is"
