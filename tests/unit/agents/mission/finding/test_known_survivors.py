"""What one UAV knows of survivors does not depend on the order in which it is told, and each rule at its bound."""

from hypothesis import given
from hypothesis import strategies as st
from seeing_uav import MODEL

from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.phone_localization import Estimate
from fanet_mw.units import US, Enu, S
from fanet_mw.wire.survivors import Found, Standing, Survivor, person_id


@given(st.permutations(range(6)))
def test_confirmations_and_refutations_come_to_the_same_in_any_order(order: list[int]) -> None:
    place = (4.0, 0.0, 4.0)
    words = [
        Found(10, 1, 0.0, 0.0, *place, 9, Standing.CONFIRMED),
        Found(20, 1, 3.0, 0.0, *place, 8, Standing.REFUTED),
        Found(15, 1, 0.0, 5.0, *place, 7, Standing.CONFIRMED),
        Found(12, 1, 57.0, 0.0, *place, 6, Standing.CONFIRMED),
        Found(19, 1, 1.0, 0.0, *place, 5, Standing.ESTIMATED),
        Found(21, 1, 50.0, 0.0, 90.0, 0.0, 90.0, 4, Standing.ESTIMATED),
    ]
    survivors = KnownSurvivors(MODEL)
    for at in [*order, *order]:  # told twice, as floods and hellos do
        survivors.on_found(words[at], now_ns=S)
    confirmed, estimate = survivors.by_id[1].confirmed, survivors.by_id[1].announced
    assert confirmed is not None
    assert confirmed.node == 6, "the only one that was not taken back"
    assert estimate is not None
    assert estimate.node == 4, "an estimate that is not younger than a refutation is part of the mistake"


def test_what_is_confirmed_again_at_the_same_place_after_it_was_taken_back_holds() -> None:
    survivors = KnownSurvivors(MODEL)
    told = Found(10, 1, 0.0, 0.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED)
    assert survivors.on_found(told, now_ns=S)
    assert survivors.on_found(told._replace(t_us=20, standing=Standing.REFUTED), now_ns=S)
    assert not survivors.on_found(told, now_ns=S)
    assert survivors.on_found(told._replace(t_us=30), now_ns=S)
    assert survivors.is_confirmed(1)


def found(
    standing: Standing = Standing.CONFIRMED, *, t_us: int = 10, node: int = 9, at_m: float = 0.0, sigma_m: float = 2.0,
    survivor: int = 1,
) -> Found:  # fmt: skip
    return Found(t_us, survivor, at_m, 0.0, sigma_m**2, 0.0, sigma_m**2, node, standing)


def knowing(*words: Found) -> KnownSurvivors:
    survivors = KnownSurvivors(MODEL)
    for word in words:
        survivors.on_found(word, now_ns=S)
    return survivors


def test_of_estimates_and_of_verdicts_inside_the_most_exact_stays_and_of_equal_ones_the_first() -> None:
    for standing in (Standing.ESTIMATED, Standing.INSIDE, Standing.AMONG):
        words = [
            found(standing, node=node, sigma_m=sigma_m) for node, sigma_m in ((1, 9.0), (2, 9.0), (3, 8.0), (4, 8.5))
        ]
        for count, kept in ((1, 1), (2, 1), (3, 3), (4, 3)):
            known = knowing(*words[:count]).by_id[1]
            word = known.announced if standing is Standing.ESTIMATED else known.settled
            assert word is not None
            assert word.node == kept


def test_a_verdict_is_news_once_and_an_estimate_never() -> None:
    survivors = KnownSurvivors(MODEL)
    news = [
        survivors.on_found(word, now_ns=S)
        for word in (
            found(Standing.ESTIMATED), found(Standing.INSIDE), found(Standing.INSIDE, sigma_m=1.0), found(t_us=12),
            found(t_us=13), found(Standing.INSIDE), found(Standing.REFUTED, t_us=13), found(Standing.REFUTED, t_us=14),
            found(t_us=14), found(t_us=15),
        )
    ]  # fmt: skip
    assert news == [False, True, False, True, False, False, True, False, False, True]


def test_a_refutation_takes_back_what_is_no_younger_and_within_12_m() -> None:
    for t_us, at_m, taken in ((20, 12.0, True), (19, 0.0, False), (20, 12.1, False), (25, -12.0, True)):
        survivors = knowing(found(t_us=20), found(Standing.REFUTED, t_us=t_us, at_m=at_m))
        assert survivors.is_confirmed(1) is not taken
        assert survivors.is_outdated(found(t_us=20)) is taken
    assert not knowing(found()).is_outdated(found(Standing.ESTIMATED))


def test_the_four_youngest_refutations_of_different_places_are_kept() -> None:
    words = [found(Standing.REFUTED, t_us=t_us, at_m=50.0 * t_us) for t_us in (5, 1, 3, 2, 4)]
    known = knowing(*words).by_id[1]
    assert [one.t_us for one in known.refuted] == [2, 3, 4, 5]
    again = knowing(found(Standing.REFUTED, t_us=5), found(Standing.REFUTED, t_us=4, at_m=3.0)).by_id[1]
    assert [one.t_us for one in again.refuted] == [5], "an older one of the same place says nothing more"
    assert known.verdict == known.refuted[-1]
    assert known.was_mistaken_at(Enu(250.0, 12.0, 0.0), since_ns=5 * US)
    assert not known.was_mistaken_at(Enu(250.0, 12.1, 0.0), since_ns=5 * US)
    assert not known.was_mistaken_at(Enu(250.0, 0.0, 0.0), since_ns=5 * US + 1)


def test_a_place_is_the_confirmed_one_or_the_more_exact_of_the_own_and_the_announced() -> None:
    seen = Estimate(7.0, 7.0, 9.0, 0.0, 9.0)
    for sigma_m, place_m in ((2.9, 0.0), (3.0, 7.0), (3.1, 7.0)):
        known = knowing(found(Standing.ESTIMATED, sigma_m=sigma_m)).by_id[1]
        known.filter.on_sighting(seen)
        place = known.place()
        assert place is not None
        assert place.east_m == place_m
    confirmed = knowing(found(Standing.ESTIMATED, sigma_m=1.0), found(at_m=30.0, sigma_m=50.0)).by_id[1].place()
    assert confirmed is not None
    assert confirmed.east_m == 30.0
    assert knowing(found(Standing.REFUTED)).by_id[1].place() is None


def test_the_newest_reports_of_unconfirmed_survivors_of_the_last_8_s_are_passed_on_five_at_most() -> None:
    survivors = knowing(found(survivor=2))
    here = Enu(0.0, 0.0, 60.0)

    def tell(t_us: int, survivor: int, reporter: int) -> Survivor:
        report = Survivor(t_us, survivor, reporter, here, -60.0)
        survivors.take_report(report, now_ns=S)
        return report

    old, newer = tell(1_000_000, 3, 7), tell(2_000_000, 3, 7)
    survivors.take_report(old, now_ns=S)
    tell(2_500_000, 2, 7)
    first = tell(1_000_000, 1, 7)
    assert survivors.recent_reports(now_ns=9 * S) == [newer, first]
    assert survivors.recent_reports(now_ns=9 * S + 1) == [newer]
    same = [tell(2_000_000, survivor, reporter) for survivor, reporter in ((3, 4), (1, 9), (1, 8))]
    tell(1_000_000, 4, 1)
    assert survivors.recent_reports(now_ns=9 * S) == [same[2], same[1], same[0], newer, first]
    assert survivors.by_id[3].reporters == {4, 7}


def test_who_is_inside_is_not_sought_and_who_is_confirmed_is_found() -> None:
    survivors = knowing(found(survivor=5), found(Standing.INSIDE, survivor=4), found(Standing.ESTIMATED, survivor=3))
    assert (survivors.unconfirmed(), survivors.sought()) == ([3, 4], [3])
    assert [survivors.is_found(survivor) for survivor in (3, 4, 5, 6)] == [False, True, True, False]
    assert [survivors.is_confirmed(survivor) for survivor in (3, 4, 5, 6)] == [False, False, True, False]
    assert list(survivors.confirmed_places()) == [5]
    assert survivors.verdict(6) is None


def test_a_person_is_known_once_and_given_up_for_ever_and_2000_are_remembered() -> None:
    survivors = KnownSurvivors(MODEL)
    person = found(survivor=person_id(3, 0))
    given_up = person._replace(standing=Standing.REFUTED)
    assert [survivors.on_found(word, now_ns=S) for word in (person, person, given_up, given_up, person)] == [
        True, False, True, False, False,
    ]  # fmt: skip
    assert survivors.is_outdated(person)
    assert survivors.person_places() == {}
    for number in range(1, 2001):
        survivors.on_found(person._replace(survivor=person_id(3, number)), now_ns=S)
    assert len(survivors.persons) == 2000
    assert not survivors.is_outdated(person._replace(survivor=person_id(3, 1)))
    assert survivors.on_found(given_up._replace(survivor=person_id(3, 1)), now_ns=S), "of a known one there is news"
