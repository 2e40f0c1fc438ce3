"""Whose phone is it: one UAV's camera shows people, its receiver and its neighbors' name phones."""

import math
import random
from collections.abc import Iterable, Iterator
from typing import Final

from hypothesis import given
from hypothesis import strategies as st

from agents.mission.finding.contradictions import Contradictions
from agents.mission.finding.finds import Finds
from agents.mission.finding.identities import Identities
from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB, PhoneModel
from fanet_mw.units import US, Enu, S
from fanet_mw.wire.survivors import Found, Standing, Survivor

MODEL: Final = PhoneModel(power_dbm=15, exponent=3, shadowing_db=4, offset_db=1, threshold_dbm=-90)
UP_M: Final = 65.0
LANE_M: Final = 177.0
SIDE_M: Final = 62.0
"""How far to the side a camera sees."""
CIRCLE_M: Final = 40.0


def mean_dbm(truth: Enu, at: Enu) -> float:
    return MODEL.power_dbm - REFERENCE_LOSS_DB - 30 * math.log10(at.minus(truth).norm())


class Uav:
    """What one UAV knows."""

    def __init__(self) -> None:
        self.finds = Finds(MODEL)
        self.identities = Identities(self.finds)
        self.named: dict[int, Enu] = {}

    def hear(self, survivor: int, node: int, at: Enu, rssi_dbm: float, *, now_ns: int = 0) -> None:
        self.finds.take_report(Survivor(now_ns // US, survivor, node, at, rssi_dbm), now_ns=now_ns)

    def see(self, *people: Enu, now_ns: int) -> list[int]:
        """An image from close by; who may be confirmed, is."""
        for at in people:
            self.identities.on_sighting(at, sigma_m=2, close=True, now_ns=now_ns)
        sure = self.identities.review(now_ns)
        for survivor in sure:
            place = self.finds.known[survivor].place()
            assert place is not None
            self.finds.on_found(Found(now_ns // US, survivor, *place, 1, Standing.CONFIRMED), now_ns=now_ns)
            self.named[survivor] = Enu(place.east_m, place.north_m, 0)
        return sure


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
        finds = self.uav.finds
        places = [finds.known[survivor].place() for survivor in finds.unconfirmed()]
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
                elif node == 1 and survivor in self.uav.finds.unconfirmed():
                    self.uav.finds.known[survivor].filter.on_silence(at)

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


def test_a_sighting_that_was_not_repeated_is_forgotten_and_names_nobody() -> None:
    uav = Uav()
    for node in range(1, 5):
        for north in (-60, 0, 60):
            at = Enu(40.0 * node - 100, north, UP_M)
            uav.hear(1, node, at, mean_dbm(Enu(0, 0, 0), at))
    uav.see(Enu(0, 0, 0), now_ns=0)
    assert uav.finds.known[1].filter.is_seen
    uav.see(now_ns=11 * S)
    assert not uav.finds.known[1].filter.is_seen


def test_where_somebody_is_confirmed_a_second_person_is_named_only_after_many_more_sightings() -> None:
    uav = Uav()
    for survivor in (1, 2):
        for node in range(1, 5):
            for north in (-60, 0, 60):
                at = Enu(40.0 * node - 100, north, UP_M)
                uav.hear(survivor, node, at, mean_dbm(Enu(0, 0, 0), at))
    uav.finds.on_found(Found(0, 1, 1.0, 1.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED), now_ns=0)
    named = [second for second in range(90) if uav.see(Enu(0, 0, 0), now_ns=second * S)]
    assert uav.named.keys() == {2}
    assert named[0] >= 20


def test_somebody_who_is_confirmed_is_not_taken_for_the_owner_of_a_phone_that_was_hardly_heard() -> None:
    """Whoever circles about a confirmed person sees that person again and again."""
    uav = Uav()
    uav.finds.on_found(Found(0, 3, 0.0, 0.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED), now_ns=0)
    for node, at, rssi_dbm in ((4, (84, -12), -88.1), (9, (98, -5), -87.0), (5, (60, -80), -88.1)):
        uav.hear(7, node, Enu(*at, UP_M), rssi_dbm)
    for second in range(60):
        uav.see(Enu(0, 0, 0), now_ns=second * S)
    place = uav.finds.known[7].place()
    assert place is not None
    assert place.sigma_m > 30.0, "three powers do not tell where a phone is"
    assert not uav.named


# --- confirmations that were mistaken -------------------------------------------------------------------------------


def mistaken() -> tuple[Uav, Contradictions]:
    """One UAV that was told that survivor 1 lies where in truth survivor 2 lies; survivor 1 lies 57 m to the east."""
    uav = Uav()
    for survivor in (1, 2):
        for node, east in ((8, 120.0), (9, -60.0)):
            uav.hear(
                survivor, node, Enu(east, 200, UP_M), mean_dbm(Enu(57.0 * (survivor == 1), 0, 0), Enu(east, 200, UP_M))
            )
    uav.finds.on_found(Found(S // US, 1, 0.0, 0.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED), now_ns=S)
    return uav, Contradictions(uav.finds, uav.identities)


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
    uav, contradictions = mistaken()
    assert contradictions.review() == [], "what was heard before it does not tell"
    refuted = []
    for second in (10, 20, 30):
        pass_by(uav, (1, 2), second=second, sees=(Enu(0, 0, 0), Enu(57, 0, 0)))
        for survivor in contradictions.review():
            found = uav.finds.known[survivor].confirmed
            assert found is not None
            uav.finds.on_found(found._replace(t_us=second * S // US, standing=Standing.REFUTED), now_ns=second * S)
            refuted.append(survivor)
    assert set(refuted) == {1, 2}, "the second had been taken for the first in turn"
    for second in range(30, 40):
        uav.see(Enu(0, 0, 0), Enu(57, 0, 0), now_ns=second * S)
    assert {survivor: round(place.east) for survivor, place in uav.named.items()} == {1: 57, 2: 0}


def test_a_right_confirmation_is_not_contradicted() -> None:
    uav, contradictions = mistaken()
    uav.finds.known[1].confirmed = None
    contradictions.review()
    uav.finds.on_found(Found(2 * S // US, 1, 57.0, 0.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED), now_ns=S)
    contradictions.review()
    pass_by(uav, (1, 2), second=10, sees=(Enu(0, 0, 0), Enu(57, 0, 0)))
    assert contradictions.review() == []


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
    finds = Finds(MODEL)
    for at in [*order, *order]:  # told twice, as floods and hellos do
        finds.on_found(words[at], now_ns=S)
    confirmed, estimate = finds.known[1].confirmed, finds.known[1].announced
    assert confirmed is not None
    assert confirmed.node == 6, "the only one that was not taken back"
    assert estimate is not None
    assert estimate.node == 4, "an estimate that is not younger than a refutation is part of the mistake"


def test_what_is_confirmed_again_at_the_same_place_after_it_was_taken_back_holds() -> None:
    finds = Finds(MODEL)
    told = Found(10, 1, 0.0, 0.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED)
    assert finds.on_found(told, now_ns=S)
    assert finds.on_found(told._replace(t_us=20, standing=Standing.REFUTED), now_ns=S)
    assert not finds.on_found(told, now_ns=S)
    assert finds.on_found(told._replace(t_us=30), now_ns=S)
    assert finds.is_confirmed(1)
