"""Whose phone is it? A camera or a voice shows people and names none of them; a receiver names phones and shows none.

    sightings near each other        -> one person, whose place is a Kalman filter's
    people x phones, all at once     -> the assignment that makes what was heard of all phones together most likely
    sure enough                      -> the owner is named: every other assignment of this person is less likely by far

The cost of a pair is how much less likely the phone's powers are from the person's place than from the best place:
twice a difference of logarithms, as chi-square with 2 degrees for the true pair. Two people side by side can be told
apart only by many powers, so a UAV that is not sure yet waits and measures on; after a while less is asked for.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from agents.mission.finding.finds import SAME_PLACE_M, Finds, estimate_of
from agents.mission.finding.phone_filter import Estimate
from agents.mission.hungarian import assign
from fanet_mw.units import Enu, S
from fanet_mw.wire.search import Found

_SAME_SIGMAS: Final = 2.5
"""Sightings are of one person, too, that are nearer than this many standard deviations: those of voices are wide."""
_GATE: Final = 16.0
"""The cost above which a person is taken to carry none of the phones that were heard, rather than one that the place
makes unlikely. It is above 11.8, the 99.7 % of chi-square with 2 degrees, because the shadowing of neighboring samples
is not independent."""
_VAGUE_M: Final = 80.0
"""A phone whose place has a larger standard deviation than this could be that of any person."""
_NEAR_M: Final = 400.0
"""Phones that were first heard farther from a person are not that person's."""
_BESIDE_M: Final = 150.0
"""People farther from each other than this are not taken for each other."""
_FORGOTTEN_NS: Final = 60 * S
_FALSE_ALARM_NS: Final = 10 * S
"""A sighting that no other follows within this time was a false alarm."""
_SIGHTINGS: Final = 2
"""The sightings from close by after which a person is confirmed."""
_SURE_M: Final = 3.5
"""The largest standard deviation of a confirmed place."""
_SAMPLES: Final = 6
_REPORTERS: Final = 2
"""Fewer received powers than `_SAMPLES`, or by fewer nodes than this, do not tell whose phone it is."""
_SAMPLES_ALONE: Final = 8
"""So many powers received by one node are enough: at the edge of the area no other may ever hear that phone."""
_MARGIN: Final = 9.0
"""The next best assignment must cost so much more: it is then 90 times less likely."""
_IMPOSSIBLE: Final = 1e6
_LEAST_MARGIN: Final = 2.0
_PATIENT_NS: Final = 15 * S
_IMPATIENT_NS: Final = 50 * S
"""Times since the first sighting: before `_PATIENT_NS` the whole margin is asked for, after this one the least."""
_REFUTED_COST: Final = 9.0
"""The further cost at a place at which the same survivor was confirmed by mistake: another UAV knows more of it."""
_TAKEN_GATE: Final = 6.0
_TAKEN_SIGHTINGS: Final = 20
"""The further sightings after which a second person beside a confirmed one is believed, if a phone fits."""
_TAKEN_SIGMA_M: Final = 30.0


@dataclass
class PersonTrack:
    """One person on the ground, as the sightings so far show that person."""

    place: Estimate
    first_ns: int
    last_ns: int
    sightings: int = 1
    close: int = 0
    """The number of sightings from close by."""
    owner_of: int | None = None
    """The survivor whose phone this person was last taken to carry."""
    taken: int | None = None
    """The number of sightings when a survivor was confirmed at this place; None: none has been."""

    def on_sighting(self, at: Enu, variance_m2: float, now_ns: int) -> None:
        """Take in one more sighting, by a Kalman filter with the same variance along each axis."""
        before = self.place
        gain = before.east_variance_m2 / (before.east_variance_m2 + variance_m2)
        self.place = Estimate(
            before.east_m + gain * (at.east - before.east_m),
            before.north_m + gain * (at.north - before.north_m),
            before.east_variance_m2 * (1 - gain),
            0.0,
            before.north_variance_m2 * (1 - gain),
        )
        self.sightings += 1
        self.last_ns = now_ns


class Identities:
    """The people whom one UAV has seen, and whose phones they carry."""

    def __init__(self, finds: Finds) -> None:
        self._finds = finds
        self._people: list[PersonTrack] = []

    def on_sighting(self, at: Enu, *, sigma_m: float, close: bool, now_ns: int) -> int | None:
        """Take in that a sensor shows a person; `close`: from so near that it certainly is one.

        Returns the survivor whose phone that person was last taken to carry.
        """
        near = min(self._people, key=lambda person: person.place.distance_m(at), default=None)
        variance = sigma_m * sigma_m
        if near is None or near.place.distance_m(at) > max(SAME_PLACE_M, _SAME_SIGMAS * sigma_m):
            near = PersonTrack(Estimate(at.east, at.north, variance, 0.0, variance), now_ns, now_ns)
            self._people.append(near)
        else:
            near.on_sighting(at, variance, now_ns)
        near.close += close
        return near.owner_of

    def review(self, now_ns: int) -> list[int]:
        """Assign phones to people anew; returns the survivors who may be confirmed now, in order of id."""
        self._people = [person for person in self._people if _is_remembered(person, now_ns)]
        for survivor in self._finds.unconfirmed():
            self._finds.known[survivor].filter.on_sighting(None)
        people = [person for person in self._people if self._may_be_named(person, now_ns)]
        phones = self._phones(people)
        if not people or not phones:
            return []
        costs = [[self._cost_of(person, phone) for phone in phones] for person in people]
        nobody = [_GATE if person.taken is None else _TAKEN_GATE for person in people]
        least, chosen = _assigned(costs, nobody)
        sure = []
        for row, (person, column) in enumerate(zip(people, chosen, strict=True)):
            person.owner_of = None if column is None else phones[column]
            if column is None:
                continue
            survivor = phones[column]
            self._finds.known[survivor].filter.on_sighting(person.place)
            if self._is_confirmable(person, survivor):
                margin = self._next_best(costs, nobody, row, column, person) - least
                if margin >= _asked_for(person, now_ns):
                    sure.append(survivor)
        return sorted(sure)

    def against(self, confirmed: Found) -> float:
        """How much less likely a confirmed pair is than the best assignment without it; 0 or less: it is in the best.

        The people are those who have been seen and those who were confirmed, near the place of this confirmation.
        """
        at = estimate_of(confirmed).at
        named = {
            survivor: place
            for survivor, find in sorted(self._finds.known.items())
            if find.confirmed is not None and (place := find.place()) is not None and place.distance_m(at) <= _BESIDE_M
        }
        seen = [
            person.place
            for person in self._people
            if person.close >= _SIGHTINGS and person.place.distance_m(at) <= _BESIDE_M
            if all(place.distance_m(person.place.at) > SAME_PLACE_M for place in named.values())
        ]
        people = [*named.values(), *seen]
        phones = [*named, *self._open_near(people)]
        costs = [[self._cost(place, phone) for phone in phones] for place in people]
        nobody = [_GATE] * len(people)
        least, _ = _assigned(costs, nobody)
        row = phones.index(confirmed.survivor)
        kept = [[cost if column == row else _IMPOSSIBLE for column, cost in enumerate(costs[row])]]
        only = [_IMPOSSIBLE if at_row == row else cost for at_row, cost in enumerate(nobody)]
        return _assigned([*costs[:row], *kept, *costs[row + 1 :]], only)[0] - least

    def _may_be_named(self, person: PersonTrack, now_ns: int) -> bool:
        """False where a survivor has been confirmed, until further sightings show that a second person lies there."""
        at = person.place.at
        taken = any(
            find.confirmed is not None and (place := find.place()) is not None and place.distance_m(at) <= SAME_PLACE_M
            for find in self._finds.known.values()
        )
        if taken and person.taken is None:
            person.taken, person.first_ns = person.sightings, now_ns
        elif not taken and any(find.was_mistaken_at(at) for find in self._finds.known.values()):
            person.taken = None
        return person.taken is None or person.sightings - person.taken >= _TAKEN_SIGHTINGS

    def _next_best(
        self, costs: Sequence[Sequence[float]], nobody: Sequence[float], row: int, column: int, person: PersonTrack
    ) -> float:
        """The least cost if this person carries another phone or, at a place that is taken, no phone."""
        others = [list(one) for one in costs]
        others[row][column] = _IMPOSSIBLE
        bound = list(nobody)
        bound[row] += _MARGIN if person.taken is None else 0.0
        return _assigned(others, bound)[0]

    def _phones(self, people: Sequence[PersonTrack]) -> list[int]:
        """The open survivors whose phones one of these people may carry."""
        return self._open_near([person.place for person in people])

    def _open_near(self, places: Sequence[Estimate]) -> list[int]:
        """The open survivors whose phones were heard near one of these places."""
        return [
            survivor
            for survivor in self._finds.unconfirmed()
            if self._finds.known[survivor].reporters
            and any(self._finds.known[survivor].filter.near(place.at, within_m=_NEAR_M) for place in places)
        ]

    def _cost_of(self, person: PersonTrack, survivor: int) -> float:
        """The cost of one pair. Where a survivor is confirmed, only a phone whose place is well known can be that of a
        second person: any other phone that was heard not far from there would fit as well.
        """
        if person.taken is not None and not self._is_heard_within(_TAKEN_SIGMA_M, survivor):
            return _IMPOSSIBLE
        return self._cost(person.place, survivor)

    def _is_heard_within(self, sigma_m: float, survivor: int) -> bool:
        """True if received powers alone tell the place of a phone with at most this standard deviation."""
        heard = self._finds.known[survivor].filter.estimate_by_power()
        return heard is not None and heard.sigma_m <= sigma_m

    def _cost(self, place: Estimate, survivor: int) -> float:
        find, at = self._finds.known[survivor], place.at
        doubt = _REFUTED_COST if find.was_mistaken_at(at) else 0.0
        return min(_IMPOSSIBLE, find.filter.deficit(at.east, at.north) + doubt)

    def _is_confirmable(self, person: PersonTrack, survivor: int) -> bool:
        """True if enough has been seen of a person and enough been heard of a phone."""
        find = self._finds.known[survivor]
        enough = _SAMPLES if len(find.reporters) >= _REPORTERS else _SAMPLES_ALONE
        return (
            person.close >= _SIGHTINGS
            and person.place.sigma_m <= _SURE_M
            and self._is_heard_within(_VAGUE_M if person.taken is None else _TAKEN_SIGMA_M, survivor)
            and find.filter.included_powers >= enough
        )


def _is_remembered(person: PersonTrack, now_ns: int) -> bool:
    return now_ns - person.last_ns <= (_FORGOTTEN_NS if person.sightings > 1 else _FALSE_ALARM_NS)


def _asked_for(person: PersonTrack, now_ns: int) -> float:
    """The margin that is asked for, which shrinks the longer a person has been seen."""
    share = (now_ns - person.first_ns - _PATIENT_NS) / (_IMPATIENT_NS - _PATIENT_NS)
    return _MARGIN - (_MARGIN - _LEAST_MARGIN) * min(1.0, max(0.0, share))


def _assigned(costs: Sequence[Sequence[float]], nobody: Sequence[float]) -> tuple[float, list[int | None]]:
    """The least total, and the phone of each person; `nobody` has the cost of each person's carrying none of them."""
    phones, people = len(costs[0]), len(costs)
    table = [[*row, *(nobody[i] if i == j else _IMPOSSIBLE for j in range(people))] for i, row in enumerate(costs)]
    chosen = assign(table)
    total = math.fsum(table[i][column] for i, column in enumerate(chosen))
    return total, [column if column < phones else None for column in chosen]
