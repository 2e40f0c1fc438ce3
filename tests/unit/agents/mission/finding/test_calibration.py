"""How strong phones are is learnt from those whose owners have been seen, and places the others."""

import math
import random
import statistics
from collections.abc import Iterator, Sequence
from typing import Final

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples, slow

from agents.mission.finding.calibration import common_offset, likelihood
from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB, Estimate, PhoneModel
from fanet_mw.units import Enu
from fanet_mw.wire.survivors import MOST_DBM, Found, Standing, Survivor

MODEL: Final = PhoneModel(power_dbm=15, exponent=3, shadowing_db=4, offset_db=1, threshold_dbm=-90)
UP_M: Final = 50.0
PASS: Final = [(lane + 1, Enu(30.0 * step, 150.0 * lane, UP_M)) for lane in (0, 1) for step in range(-8, 9)]
"""Two UAVs fly past in lanes 150 m apart."""


def circle(phone: Enu) -> list[tuple[int, Enu]]:
    """Another one circles about whom it is to confirm."""
    places = [(40 * math.cos(turn * math.pi / 4), 40 * math.sin(turn * math.pi / 4)) for turn in range(8)]
    return [(3, Enu(phone.east + east, phone.north + north, UP_M)) for east, north in places]


def heard(
    phone: Enu, places: Sequence[tuple[int, Enu]], offset_db: float, drawn: random.Random
) -> Iterator[tuple[int, Enu, float]]:
    """The powers of a phone at these places that are above the threshold."""
    for node, at in places:
        lost_db = REFERENCE_LOSS_DB + 10 * MODEL.exponent * math.log10(at.minus(phone).norm())
        rssi_dbm = MODEL.power_dbm + offset_db - lost_db + drawn.gauss(0, MODEL.shadowing_db)
        if rssi_dbm >= MODEL.threshold_dbm:
            yield node, at, rssi_dbm


def somewhere(drawn: random.Random) -> Enu:
    return Enu(drawn.uniform(-40, 40), drawn.uniform(30, 90), 0.0)


def confirm(
    survivors: KnownSurvivors, survivor: int, at: Enu, *, standing: Standing = Standing.CONFIRMED, t_us: int = 0
) -> None:
    survivors.on_found(Found(t_us, survivor, at.east, at.north, 4.0, 0.0, 4.0, 9, standing), now_ns=0)


def swarm(confirmed: int, *, offset_db: float, drawn: random.Random) -> KnownSurvivors:
    """What a UAV knows after so many survivors were confirmed, whose phones differ from each other by 1 dB."""
    survivors = KnownSurvivors(MODEL)
    for survivor in range(1, confirmed + 1):
        phone, own_db = somewhere(drawn), drawn.gauss(0, MODEL.offset_db)
        for node, at, rssi_dbm in heard(phone, [*PASS, *circle(phone)], offset_db + own_db, drawn):
            survivors.take_report(Survivor(0, survivor, node, at, rssi_dbm), now_ns=0)
        confirm(survivors, survivor, phone)
    return survivors


def error_m(survivors: KnownSurvivors, *, offset_db: float, draw: int) -> float | None:
    """How far from the truth the next phone is placed, which the same two UAVs hear; None: they do not."""
    drawn = random.Random(f"next/{draw}")
    phone = somewhere(drawn)
    powers = list(heard(phone, PASS, offset_db, drawn))
    for node, at, rssi_dbm in powers:
        survivors.take_report(Survivor(0, 99, node, at, rssi_dbm), now_ns=0)
    if not powers:
        return None
    for _, at in PASS:
        if all(at != place for _, place, _ in powers):
            survivors.by_id[99].filter.on_silence(at)
    place = survivors.by_id[99].filter.estimate()
    assert place is not None
    return place.distance_m(phone)


def median_error_m(confirmed: int, *, offset_db: float) -> float:
    errors = []
    for draw in range(24):
        survivors = swarm(confirmed, offset_db=offset_db, drawn=random.Random(f"confirmed/{draw}"))
        error = error_m(survivors, offset_db=offset_db, draw=draw)
        errors += [] if error is None else [error]
    return statistics.median(errors)


@pytest.mark.slow
def test_weak_phones_are_placed_as_well_as_others_once_some_survivors_are_confirmed() -> None:
    assert median_error_m(0, offset_db=-6) > 100, "a weak phone is taken for one far away"
    assert median_error_m(1, offset_db=-6) < 80
    assert median_error_m(4, offset_db=-6) < 45


@pytest.mark.parametrize("confirmed", [1, *slow(4)])
def test_phones_that_are_as_assumed_are_placed_as_before(confirmed: int) -> None:
    assert median_error_m(confirmed, offset_db=0) < 1.15 * median_error_m(0, offset_db=0)


def test_a_refutation_takes_back_what_its_confirmation_told() -> None:
    drawn = random.Random(5)
    survivors = swarm(3, offset_db=-6, drawn=drawn)
    error_m(survivors, offset_db=-6, draw=1)
    place, offset = survivors.by_id[99].filter.estimate(), survivors.offset
    confirm(survivors, 4, Enu(0, 60, 0), t_us=5)  # nobody has heard that phone
    assert survivors.offset == offset
    for survivor in (1, 2, 3):
        found = survivors.by_id[survivor].confirmed
        assert found is not None
        confirm(survivors, survivor, Enu(found.east_m, found.north_m, 0), standing=Standing.REFUTED, t_us=9)
    assert survivors.offset == (0, 0)
    fresh = KnownSurvivors(MODEL)
    error_m(fresh, offset_db=-6, draw=1)
    assert survivors.by_id[99].filter.estimate() == fresh.by_id[99].filter.estimate() != place


def test_many_powers_of_one_phone_are_one_draw_of_the_population() -> None:
    drawn = random.Random(3)
    phone = Enu(0, 60, 0)
    around = [Enu(20.0 * east, 60 + 20.0 * north, UP_M) for east in range(-3, 4) for north in range(-3, 4)]
    powers = [(at, rssi_dbm) for _, at, rssi_dbm in heard(phone, [(3, at) for at in around], 6, drawn)]
    alike, unlike = (
        likelihood(Estimate(phone.east, phone.north, 4, 0, 4), powers, MODEL._replace(offset_db=offset_db))
        for offset_db in (0.25, 3.0)
    )
    assert common_offset([alike]).mean_db > 3
    assert common_offset([unlike]) == (0, 0), "where phones differ by 3 dB, one tells little of the others"
    assert common_offset([unlike] * 9).sigma_db >= 0.75, "nine phones, not 441 powers"


@given(st.permutations(range(1, 5)))
@examples(6)
def test_the_order_in_which_survivors_are_confirmed_does_not_matter(order: list[int]) -> None:
    offsets = set()
    for told in (range(1, 5), order):
        survivors, drawn = KnownSurvivors(MODEL), random.Random(8)
        phones = {survivor: somewhere(drawn) for survivor in range(1, 5)}
        for survivor, phone in phones.items():
            for node, at, rssi_dbm in heard(phone, circle(phone), -4, drawn):
                survivors.take_report(Survivor(0, survivor, node, at, rssi_dbm), now_ns=0)
        for survivor in told:
            confirm(survivors, survivor, phones[survivor])
        offsets.add(survivors.offset)
    assert len(offsets) == 1
    assert offsets.pop().mean_db < -2


@given(st.floats(-8, 8), st.integers(0, 10**6))
@examples(8)
def test_the_estimate_converges_to_what_is_common_to_all_phones(offset_db: float, seed: int) -> None:
    offset = swarm(10, offset_db=offset_db, drawn=random.Random(seed)).offset
    assert abs(offset.mean_db - offset_db) < 2.0
    assert offset.sigma_db <= 1.25


positions = st.builds(Enu, st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(-100, 1000))
powers_dbm = st.floats(-MOST_DBM, MOST_DBM)
forged = st.lists(st.tuples(st.integers(1, 3), positions, powers_dbm), max_size=60)


@given(st.lists(forged, max_size=5))
@examples(10)
def test_no_powers_at_all_drive_it_beyond_its_bound(phones: list[list[tuple[int, Enu, float]]]) -> None:
    survivors = KnownSurvivors(MODEL)
    for survivor, powers in enumerate(phones, start=1):
        for node, at, rssi_dbm in powers:
            survivors.take_report(Survivor(0, survivor, node, at, rssi_dbm), now_ns=0)
        confirm(survivors, survivor, Enu(0, 0, 0))
    assert abs(survivors.offset.mean_db) <= 12
    assert 0 <= survivors.offset.sigma_db <= 12


@given(forged, st.floats(-MOST_DBM, MOST_DBM))
@examples(10)
def test_one_phone_whose_powers_are_forged_does_not_outweigh_four_that_are_true(
    powers: list[tuple[int, Enu, float]], near_dbm: float
) -> None:
    survivors = swarm(4, offset_db=0, drawn=random.Random(2))
    before = survivors.offset.mean_db
    for node, at, rssi_dbm in [*powers, *((4, at, near_dbm) for _, at in circle(Enu(0, 0, 0)))]:
        survivors.take_report(Survivor(0, 50, node, at, rssi_dbm), now_ns=0)
    confirm(survivors, 50, Enu(0, 0, 0))
    assert abs(survivors.offset.mean_db - before) <= 1.0
