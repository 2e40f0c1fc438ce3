"""Whose phone is it: one UAV's camera shows people, its receiver and its neighbors' name phones."""

import math
import random
from collections.abc import Iterator, Sequence
from typing import Final

import pytest
from seeing_uav import MODEL, UP_M, Uav, mean_dbm

from agents.mission.finding.identities import Sighting
from fanet_mw.units import Enu, S
from fanet_mw.wire.survivors import Found, Standing

LANE_M: Final = 177.0
SIDE_M: Final = 62.0
"""How far to the side a camera sees."""
CIRCLE_M: Final = 40.0


class Pass:
    """Three UAVs fly north in lanes beside each other; the middle one circles about whom it has not confirmed yet."""

    def __init__(self, seed: int, *, apart_m: float) -> None:
        self._random = random.Random(f"pass/{seed}")
        angle, east = self._random.uniform(0, 2 * math.pi), self._random.uniform(-80, 80)
        half = Enu(apart_m / 2 * math.cos(angle), apart_m / 2 * math.sin(angle), 0)
        self.truth = {1: Enu(east + half.east, half.north, 0), 2: Enu(east - half.east, -half.north, 0)}
        self._shadowing: dict[tuple[int, int, int], float] = {}
        self.uav = Uav()

    def fly(self) -> None:
        here, step_m = Enu(0, -250, UP_M), 5.0
        for step in range(150):
            now_ns, line = step * S // 2, -250 + 3.75 * step
            goal = self._goal(line, step)
            off = goal.minus(here)
            share = min(1.0, step_m / max(1e-9, off.norm()))
            here = Enu(here.east + share * off.east, here.north + share * off.north, UP_M)
            if step % 2 == 0:
                self._listen((here, Enu(LANE_M, line, UP_M), Enu(-LANE_M, line, UP_M)), now_ns)
            self.uav.see(*self._image(here), now_ns=now_ns)

    def _goal(self, line: float, step: int) -> Enu:
        survivors = self.uav.survivors
        places = [survivors.by_id[survivor].place() for survivor in survivors.unconfirmed()]
        near = [
            place for place in places if place is not None and place.sigma_m < 50 and abs(place.north_m - line) < 140
        ]
        if not near:
            return Enu(0, line, UP_M)
        east = near[0].east_m + CIRCLE_M * math.cos(step / 8)
        north = near[0].north_m + CIRCLE_M * math.sin(step / 8)
        return Enu(max(-58.0, min(58.0, east)), max(line - 140, min(line, north)), UP_M)

    def _listen(self, places: tuple[Enu, ...], now_ns: int) -> None:
        for survivor, truth in self.truth.items():
            for node, at in enumerate(places, start=1):
                cell = survivor, math.floor(at.east / 25), math.floor(at.north / 25)
                shadowing_db = self._shadowing.setdefault(cell, self._random.gauss(0, MODEL.shadowing_db))
                rssi_dbm = mean_dbm(truth, at) + shadowing_db
                if rssi_dbm >= MODEL.threshold_dbm:
                    self.uav.hear(survivor, node, at, rssi_dbm, now_ns=now_ns)
                elif node == 1 and survivor in self.uav.survivors.unconfirmed():
                    self.uav.survivors.by_id[survivor].filter.on_silence(at)

    def _image(self, here: Enu) -> Iterator[Enu]:
        for truth in self.truth.values():
            if max(abs(truth.east - here.east), abs(truth.north - here.north)) < SIDE_M and self._random.random() < 0.8:
                yield Enu(truth.east + self._random.gauss(0, 1.5), truth.north + self._random.gauss(0, 1.5), 0)


def test_two_who_lie_60_m_apart_are_not_taken_for_each_other() -> None:
    right = wrong = 0
    for seed in range(20):
        passed = Pass(seed, apart_m=60)
        passed.fly()
        for survivor, place in passed.uav.named.items():
            if place.minus(passed.truth[survivor]).norm() < 25:
                right += 1
            else:
                wrong += 1
    assert wrong <= 2
    assert right >= 36


@pytest.mark.parametrize(("apart_m", "least"), [(5, 8), (15, 12)])
def test_two_who_lie_side_by_side_are_both_found(apart_m: float, least: int) -> None:
    found = []
    for seed in range(6):
        passed = Pass(seed, apart_m=apart_m)
        passed.fly()
        found += [place.minus(passed.truth[survivor]).norm() for survivor, place in passed.uav.named.items()]
    assert len(found) >= least, "of twelve; if all sightings of a place were of one person, it would be two and six"
    assert max(found) < 25


def test_somebody_seen_is_the_owner_of_the_phone_that_was_heard_there() -> None:
    uav, truth = Uav(), {1: Enu(0, 0, 0), 2: Enu(160, 0, 0)}
    for survivor, at in truth.items():
        for node in range(1, 5):
            for north in (-60, 0, 60):
                place = Enu(at.east + 40 * node - 100, north, UP_M)
                uav.hear(survivor, node, place, mean_dbm(at, place))
    assert uav.see(Enu(155, 5, 0), Enu(3, -4, 0), Enu(900, 900, 0), now_ns=0) == [], "nobody is sure by one image"
    assert uav.see(Enu(155, 5, 0), Enu(3, -4, 0), Enu(900, 900, 0), now_ns=S) == [1, 2]
    assert uav.named[2].minus(truth[2]).norm() < 10
    assert uav.see(Enu(155, 5, 0), now_ns=2 * S) == [], "a survivor that was struck off is no news"


def test_a_sighting_that_was_not_repeated_is_forgotten_and_names_nobody() -> None:
    uav = Uav()
    for node in range(1, 5):
        for north in (-60, 0, 60):
            at = Enu(40.0 * node - 100, north, UP_M)
            uav.hear(1, node, at, mean_dbm(Enu(0, 0, 0), at))
    uav.see(Enu(0, 0, 0), now_ns=0)
    assert uav.survivors.by_id[1].filter.is_seen
    uav.see(now_ns=11 * S)
    assert not uav.survivors.by_id[1].filter.is_seen


def test_a_false_alarm_beside_a_person_hardly_is_the_owner_of_a_phone() -> None:
    uav = Uav()
    for node in range(1, 5):
        for north in (-60, 0, 60):
            at = Enu(40.0 * node - 100, north + 100, UP_M)
            uav.hear(1, node, at, mean_dbm(Enu(0, 0, 0), at))
    assert uav.see(Enu(0, 0, 0), Enu(60, 0, 0), now_ns=0) == []
    assert uav.see(Enu(0, 0, 0), now_ns=S) == [1]


def two_phones_at_one_place() -> Uav:
    """A UAV that has received two phones of the same place well, where the owner of the first one is confirmed."""
    uav = Uav()
    for survivor in (1, 2):
        for node in range(1, 5):
            for north in (-60, 0, 60):
                at = Enu(40.0 * node - 100, north, UP_M)
                uav.hear(survivor, node, at, mean_dbm(Enu(0, 0, 0), at))
    uav.survivors.on_found(Found(0, 1, 1.0, 1.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED), now_ns=0)
    return uav


@pytest.mark.parametrize(("both", "named"), [((), set()), ((2,), set()), ((2, 5), {2})])
def test_where_somebody_is_confirmed_a_second_person_is_named_if_two_images_have_shown_two_people(
    both: Sequence[int], named: set[int]
) -> None:
    """`both`: the images that show two people; in a single one of them the second might be a false alarm."""
    uav = two_phones_at_one_place()
    for second in range(60):
        uav.see(Enu(0, 0, 0), *([Enu(4, 3, 0)] if second in both else []), now_ns=second * S)
    assert uav.named.keys() == named


def test_however_often_a_confirmed_person_is_seen_that_is_one_person() -> None:
    uav = two_phones_at_one_place()
    for second in range(90):
        call = Sighting(Enu(1, 0, 0), 4.0, close=True)
        uav.identities.on_reading([call], here=uav.here, evidence=9.0, now_ns=second * S)
        assert uav.see(Enu(0, 0, 0), now_ns=second * S) == [], "seen and heard at the same instant"


def test_somebody_who_is_confirmed_is_not_taken_for_the_owner_of_a_phone_that_was_hardly_heard() -> None:
    """Whoever circles about a confirmed person sees that person again and again."""
    uav = Uav()
    uav.survivors.on_found(Found(0, 3, 0.0, 0.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED), now_ns=0)
    for node, at, rssi_dbm in ((4, (84, -12), -88.1), (9, (98, -5), -87.0), (5, (60, -80), -88.1)):
        uav.hear(7, node, Enu(*at, UP_M), rssi_dbm)
    for second in range(60):
        uav.see(Enu(0, 0, 0), now_ns=second * S)
    place = uav.survivors.by_id[7].place()
    assert place is not None
    assert place.sigma_m > 30.0, "three powers do not tell where a phone is"
    assert not uav.named
