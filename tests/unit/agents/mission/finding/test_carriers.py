"""Who carries a phone, of several people: each as likely as the best assignment of all phones that says so."""

import math
from itertools import permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from seeing_uav import UP_M, Uav, mean_dbm

from agents.mission.finding.carriers import IMPOSSIBLE, Carriers, carriers
from agents.mission.finding.identities import Sighting
from agents.mission.finding.phone_localization import Estimate
from fanet_mw.units import Enu, S

NOBODY = 25.0


def place(east_m: float, north_m: float = 0.0) -> Estimate:
    return Estimate(east_m, north_m, 1.0, 0.0, 1.0)


@given(
    st.integers(1, 4).flatmap(
        lambda n: st.lists(st.lists(st.floats(0, 30), min_size=n, max_size=n), min_size=n, max_size=n)
    )
)
def test_each_is_as_likely_as_the_best_assignment_in_which_it_carries_the_phone(costs: list[list[float]]) -> None:
    people = range(len(costs))
    best = dict.fromkeys([*people, None], math.inf)
    taken: list[int | None] = [*people, *[None] * len(costs)]
    for phones in set(permutations(taken, len(costs))):
        cost = math.fsum(NOBODY if phone is None else costs[person][phone] for person, phone in enumerate(phones))
        carrier = next((person for person, phone in enumerate(phones) if phone == 0), None)
        best[carrier] = min(best[carrier], cost)
    weights = {carrier: math.exp(-cost / 2) for carrier, cost in best.items()}
    whose = carriers(costs, [NOBODY] * len(costs), 0, [place(10.0 * person) for person in people])
    for person in people:
        assert whose.shares[person] == pytest.approx(weights[person] / math.fsum(weights.values()), abs=1e-9)
    assert whose.nobody == pytest.approx(weights[None] / math.fsum(weights.values()), abs=1e-9)


def test_a_phone_that_cannot_be_anybodys_is_nobodys() -> None:
    whose = carriers([[IMPOSSIBLE], [IMPOSSIBLE]], [NOBODY, NOBODY], 0, [place(0), place(9)])
    assert whose.nobody == pytest.approx(1)
    assert whose.margin(0, within_m=5) == -math.inf


def test_the_margin_is_that_of_all_others_together_but_those_found_together() -> None:
    whose = Carriers([place(0), place(14), place(60)], [0.5, 0.3, 0.1])
    assert whose.margin(0, within_m=15) == pytest.approx(2 * math.log(0.8 / 0.2)), "nobody has the rest"
    assert whose.margin(0, within_m=13.9) == pytest.approx(0)
    assert Carriers([place(0)], [1.0]).margin(0, within_m=15) > 40, "and is not infinite"


@pytest.mark.parametrize(
    ("shares", "within_m"), [([0.96, 0.04, 0.0], 0), ([0.9, 0.06, 0.04], 30), ([0.5, 0.2, 0.3], 80)]
)
def test_95_percent_of_the_likely_carriers_are_within_the_doubt(shares: list[float], within_m: float) -> None:
    whose = Carriers([place(0), place(30), place(80)], shares)
    assert whose.doubt_m(0) * math.sqrt(-2 * math.log(0.05)) == pytest.approx(within_m)


def crowd(apart_m: float, phones: int) -> Uav:
    """People in two rows, each heard by three nodes that fly past, from so far that their phones sound alike."""
    uav = Uav()
    for survivor in range(1, phones + 1):
        truth = Enu(apart_m * (survivor % 3), apart_m * (survivor // 3), 0)
        for node in range(1, 4):
            for step in range(6):
                at = Enu(-250 + 100.0 * step, 150.0 * node, UP_M)
                shadowing_db = 3.0 * math.sin(survivor + 2.3 * node + 1.7 * step)
                uav.hear(survivor, node, at, mean_dbm(truth, at) + shadowing_db)
    return uav


def test_nobody_in_a_crowd_is_named_and_after_half_a_minute_each_phone_is_told_to_be_in_it() -> None:
    uav, apart_m = crowd(18, 6), 18.0
    people = [Enu(apart_m * (one % 3), apart_m * (one // 3), 0) for one in range(1, 7)]
    told: dict[int, Estimate] = {}
    for second in range(60):
        for place_now in [Enu(second % 2, 20.0, UP_M)]:
            uav.here = Enu(place_now.east * 12, place_now.north, UP_M)
        assert uav.see(*people, now_ns=second * S) == []
        among = uav.identities.take_among()
        assert not among or second >= 30
        told |= among
    assert told.keys() == set(range(1, 7))
    for survivor, middle in told.items():
        truth = people[survivor - 1]
        assert math.hypot(middle.east_m - truth.east, middle.north_m - truth.north) < 2.45 * middle.sigma_m
    assert uav.identities.take_among() == {}, "each is told once"


def test_a_phone_is_not_told_to_be_in_a_crowd_while_its_owner_may_be_elsewhere() -> None:
    uav = crowd(18, 6)
    for second in range(60):
        sightings = [Sighting(Enu(18.0 * (one % 3), 18.0 * (one // 3), 0), 2.0, close=True) for one in (1, 2, 3)]
        uav.identities.on_reading(sightings, here=Enu(12.0 * (second % 2), 20, UP_M), evidence=9.0, now_ns=second * S)
        uav.identities.review(second * S)
        assert uav.identities.take_among() == {}, "three people, six phones"
