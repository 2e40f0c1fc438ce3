"""A confirmation that was mistaken is contradicted by what is heard and seen later; a right one is not."""

from collections.abc import Iterable
from types import SimpleNamespace
from typing import cast

from seeing_uav import UP_M, Uav, mean_dbm

from agents.mission.finding.identities import Identities
from agents.mission.finding.known_survivors import KnownSurvivor, KnownSurvivors
from agents.mission.finding.phone_localization import Estimate, PhoneFilter
from agents.mission.finding.refutation import Refutation
from fanet_mw.units import US, Enu, S
from fanet_mw.wire.survivors import Found, Standing


def mistaken() -> tuple[Uav, Refutation]:
    """One UAV that was told that survivor 1 lies where in truth survivor 2 lies; survivor 1 lies 57 m to the east."""
    uav = Uav()
    for survivor in (1, 2):
        for node, east in ((8, 120.0), (9, -60.0)):
            uav.hear(
                survivor, node, Enu(east, 200, UP_M), mean_dbm(Enu(57.0 * (survivor == 1), 0, 0), Enu(east, 200, UP_M))
            )
    uav.survivors.on_found(Found(S // US, 1, 0.0, 0.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED), now_ns=S)
    return uav, Refutation(uav.survivors, uav.identities)


def pass_by(uav: Uav, survivors: Iterable[int], *, second: int, sees: Iterable[Enu] = ()) -> None:
    """The UAV hears both phones while it flies over them."""
    for step in range(10):
        at = Enu(4.0 * second - 10, -135 + 30 * step, UP_M)
        for survivor in survivors:
            uav.hear(survivor, 1, at, mean_dbm(Enu(57.0 * (survivor == 1), 0, 0), at), now_ns=second * S)
            uav.hear(
                survivor,
                2,
                at._replace(east=at.east + 120),
                mean_dbm(Enu(57.0 * (survivor == 1), 0, 0), at._replace(east=at.east + 120)),
            )
        uav.see(*sees, now_ns=second * S)


def test_a_confirmation_is_contradicted_by_what_is_heard_and_seen_later() -> None:
    uav, refutation = mistaken()
    assert refutation.review() == [], "what was heard before it does not tell"
    refuted = []
    for second in (10, 20, 30):
        pass_by(uav, (1, 2), second=second, sees=(Enu(0, 0, 0), Enu(57, 0, 0)))
        for survivor in refutation.review():
            found = uav.survivors.by_id[survivor].confirmed
            assert found is not None
            uav.survivors.on_found(found._replace(t_us=second * S // US, standing=Standing.REFUTED), now_ns=second * S)
            refuted.append(survivor)
    assert set(refuted) == {1, 2}, "the second had been taken for the first in turn"
    for second in range(30, 40):
        uav.see(Enu(0, 0, 0), Enu(57, 0, 0), now_ns=second * S)
    assert {survivor: round(place.east) for survivor, place in uav.named.items()} == {1: 57, 2: 0}


def test_a_right_confirmation_is_not_contradicted() -> None:
    uav, refutation = mistaken()
    uav.survivors.by_id[1].confirmed = None
    refutation.review()
    uav.survivors.on_found(Found(2 * S // US, 1, 57.0, 0.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED), now_ns=S)
    refutation.review()
    pass_by(uav, (1, 2), second=10, sees=(Enu(0, 0, 0), Enu(57, 0, 0)))
    assert refutation.review() == []


def test_a_right_confirmation_that_was_taken_back_holds_in_the_end_though_another_place_was_named_meanwhile() -> None:
    uav, refutation = mistaken()
    right, elsewhere = Enu(57, 0, 0), Enu(0, 245, 0)
    uav.survivors.by_id[1].confirmed = None
    confirmed = Found(2 * S // US, 1, right.east, right.north, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED)
    uav.survivors.on_found(confirmed, now_ns=2 * S)
    uav.survivors.on_found(confirmed._replace(t_us=19 * S // US, standing=Standing.REFUTED), now_ns=19 * S)
    wrong = confirmed._replace(t_us=20 * S // US, east_m=elsewhere.east, north_m=elsewhere.north)
    uav.survivors.on_found(wrong, now_ns=20 * S)
    refutation.review()
    for second in range(24, 84, 10):
        pass_by(uav, (1, 2), second=second, sees=(Enu(0, 0, 0), right))
        for survivor in refutation.review():
            found = uav.survivors.by_id[survivor].confirmed
            assert found is not None
            uav.survivors.on_found(found._replace(t_us=second * S // US, standing=Standing.REFUTED), now_ns=second * S)
    place = uav.survivors.by_id[1].confirmed
    assert place is not None
    assert (round(place.east_m), round(place.north_m)) == (right.east, right.north)


def judged(
    received: Iterable[int], *, margin: float = 6.0, sigma_m: float = 45.0, included: int = 12, confirmed: bool = True
) -> list[bool]:
    """Whether a confirmation is contradicted, each time that so many powers of the phone have been received."""
    found = Found(0, 1, 0.0, 0.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED) if confirmed else None
    place = Estimate(0.0, 0.0, sigma_m**2, 0.0, 1.0)
    powers = SimpleNamespace(received_powers=0, included_powers=included, estimate_by_power=lambda: place)
    known = KnownSurvivor(cast("PhoneFilter", powers), confirmed=found)
    refutation = Refutation(
        cast("KnownSurvivors", SimpleNamespace(by_id={1: known})),
        cast("Identities", SimpleNamespace(against=lambda _: margin)),
    )
    verdicts = []
    for powers.received_powers in received:
        verdicts.append(refutation.review() == [1])
    return verdicts


def test_a_confirmation_is_judged_each_time_that_four_more_powers_were_received() -> None:
    assert judged([10, 13, 14, 15, 17, 18]) == [False, False, True, False, False, True]


def test_only_enough_powers_of_a_phone_whose_place_they_tell_refute_and_only_by_a_clear_margin() -> None:
    assert judged([10, 14]) == [False, True]
    assert not any(judged([10, 14], margin=5.99))
    assert not any(judged([10, 14], sigma_m=45.1))
    assert not any(judged([10, 14], included=11))
    assert not any(judged([10, 14], confirmed=False))


def test_a_survivor_who_is_confirmed_again_is_judged_by_what_is_received_from_then_on() -> None:
    found = Found(0, 1, 0.0, 0.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED)
    place = Estimate(0.0, 0.0, 1.0, 0.0, 1.0)
    powers = SimpleNamespace(received_powers=10, included_powers=20, estimate_by_power=lambda: place)
    by_id = {number: KnownSurvivor(cast("PhoneFilter", powers), confirmed=found) for number in (9, 1)}
    refutation = Refutation(
        cast("KnownSurvivors", SimpleNamespace(by_id=by_id)), cast("Identities", SimpleNamespace(against=lambda _: 9.0))
    )
    verdicts = []
    for powers.received_powers, by_id[1].confirmed in ((10, found), (12, None), (13, found), (16, found), (17, found)):
        verdicts.append(refutation.review())
    assert verdicts == [[], [], [], [9], [1]]
    powers.received_powers = 30
    assert refutation.review() == [1, 9], "in order of id"
