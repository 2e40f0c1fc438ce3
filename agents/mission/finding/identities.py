"""Decides which person carries which phone: cameras and microphones show people, receivers identify phones.

All people and all phones are assigned at once, so that all received powers together are most likely. A person's phone
is certain when all other carriers together are far less likely (`carriers.py`). The cost of a pair is twice the
difference of log-likelihoods of the phone's powers from the person's and from the best place: chi-square with 2 degrees
of freedom for a true pair.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from agents.mission.finding.camera_view import PLACE_M2
from agents.mission.finding.carriers import IMPOSSIBLE, Carriers, assigned, carriers, cost_with
from agents.mission.finding.confirmation import (
    GREATEST_MARGIN,
    is_confirmable,
    is_seen_enough,
    is_undecided,
    required_margin,
)
from agents.mission.finding.height_error import NOTHING_TOLD, HeightError
from agents.mission.finding.known_survivors import SAME_PLACE_M, KnownSurvivor, KnownSurvivors, estimate_of
from agents.mission.finding.person_track import PersonTrack
from agents.mission.finding.phone_localization import Estimate
from fanet_mw.units import Enu, S
from fanet_mw.wire.survivors import Found, is_person

_SAME_SIGMAS: Final = 4.0
"""A sighting, or a find, may belong to a person if both are at most this number of standard deviations apart."""
_STEADY_M: Final = 1.5
"""The part of the error of a sighting, along each axis, that is the same for successive sightings."""
_TOGETHER: Final = 2
"""Beside somebody who is found, another person is believed after this number of readings that show two people at once.
In a single one the second may be a false alarm.
"""
_UNREPORTED_NS: Final = 4 * S
"""How long a person who is certainly there waits, near phones without an owner, before being reported without one."""
_PLACED_NS: Final = 2 * S
"""How long such a person waits where no such phone is near: the UAV sees the person from another side meanwhile, which
places both more exactly."""
_SURE_M: Final = 3.5
"""The greatest standard deviation with which a person is reported without a phone."""
_GATE: Final = 16.0
"""The cost of assigning no phone to a person, so that a phone of a greater cost is never assigned. The value is above
11.8, the 99.7 % quantile of chi-square with 2 degrees of freedom, because the shadowing of neighboring samples is not
independent."""
_NEAR_M: Final = 400.0
"""A person does not carry a phone if the middle of its filter's grid, near the strongest power, is farther away."""
_BESIDE_M: Final = 150.0
"""A confirmed survivor can only have been mistaken for people within this distance."""
_FRESH: Final = 4
"""Among which people the owner of a phone is, is computed again only after this number of further powers."""
_ELSEWHERE: Final = 0.1
"""A survivor is not said to be among people while the probability is greater that none of them carries the phone."""
_CROWD_M: Final = 50.0
"""The greatest standard deviation of the places of people among whom a survivor is said to be."""
_BY_SIDE_M: Final = 15.0
"""People at no more than this distance are found together, so it makes no difference which of their phones is whose."""
_REFUTED_COST: Final = 9.0
"""An additional cost at a place where the same survivor was confirmed by mistake, because other UAVs know better."""
_DOUBTED_NS: Final = 30 * S
"""How long after the refutation it is added: what was received since then tells more."""
_ALONE_M: Final = 20.0
"""A person is alone if nobody else was seen within this distance, to which errors of two UAVs' positions add up."""


class Sighting(NamedTuple):
    """A place at which one reading of a sensor shows a person."""

    at: Enu
    sigma_m: float
    close: bool
    """True if it counts towards a confirmation: a camera's from any height, a microphone's from nearby only."""


class Identities:
    """The people whom one UAV has seen, and the phones that they carry."""

    def __init__(
        self, survivors: KnownSurvivors, *, bias_m: float = 0.0, height_error: HeightError | None = None
    ) -> None:
        """`bias_m`: the standard deviation of the slow error of position fixes along each axis; `height_error`: of the
        UAV, as far as known so far; None: heights are right.
        """
        self._survivors = survivors
        self._height_error = height_error or HeightError()
        self._steady_m2 = _STEADY_M * _STEADY_M + bias_m * bias_m
        self._people: list[PersonTrack] = []
        self._raised_m = 0.0
        """The error of the height by which the places of all people are corrected."""
        self._among: dict[int, Estimate] = {}
        self._weighed: dict[int, int] = {}
        """The number of powers of each phone when it was last computed among whom its owner is."""
        self._now_ns = 0

    def on_reading(
        self, sightings: Sequence[Sighting], *, here: Enu, evidence: float, now_ns: int
    ) -> list[PersonTrack]:
        """A reading shows people; `evidence`: of one sighting. Returns the person of each, known or new."""
        self._height_error.advance(now_ns)
        people = self._people
        leans = [_lean(sighting.at, here) for sighting in sightings]
        sightings = [self._corrected(sighting, lean) for sighting, lean in zip(sightings, leans, strict=True)]
        costs = [
            [person.distance2(sighting.at, sighting.sigma_m**2 + self._steady_m2) for person in people]
            for sighting in sightings
        ]
        chosen = assigned(costs, [_SAME_SIGMAS * _SAME_SIGMAS] * len(sightings))[1] if people and sightings else []
        shown: list[PersonTrack] = []
        for row, (at, sigma_m, close) in enumerate(sightings):
            column, variance = chosen[row] if chosen else None, sigma_m * sigma_m
            if column is None:
                place = Estimate(at.east, at.north, variance, 0.0, variance)
                shown.append(PersonTrack(place, now_ns, now_ns, here, evidence, leans[row]))
            else:
                shown.append(person := people[column])
                lean = _lean(person.place.at, here)  # the sighting's own would hold its error
                told = evidence - self._surprise(person, at, variance)
                self._learn_height(person, at, variance, lean)
                person.on_sighting(at, variance, here=here, evidence=told, now_ns=now_ns, lean=lean)
            shown[-1].close_sightings += close
        self._people = [*people, *(person for person in shown if person not in people)]
        self._correct_places()
        for person in shown:
            person.together += any(
                other is not person and other.place.distance_m(person.place.at) <= SAME_PLACE_M for other in shown
            )
        return shown

    def _surprise(self, person: PersonTrack, at: Enu, variance_m2: float) -> float:
        """By how much less a sighting proves that a person is there, the farther away it is and the less exactly both
        are placed, because more false alarms then pass for the same person.
        """
        of_both_m2 = person.place.east_variance_m2 + variance_m2 + self._steady_m2
        wider = max(1.0, 2 * math.pi * of_both_m2 / PLACE_M2)
        return person.place.distance_m(at) ** 2 / of_both_m2 / 2 + math.log(wider)

    def _corrected(self, sighting: Sighting, lean: tuple[float, float]) -> Sighting:
        """The sighting from the height at which the UAV is by all it knows so far."""
        at, up_m = sighting.at, self._height_error.m
        return sighting._replace(at=at._replace(east=at.east + up_m * lean[0], north=at.north + up_m * lean[1]))

    def _learn_height(self, person: PersonTrack, at: Enu, variance_m2: float, lean: tuple[float, float]) -> None:
        """Learn the error of the UAV's height from a person seen again with another lean (`_lean`): that error which
        puts both sightings in one place.
        """
        up_m, place = self._height_error.m, person.place
        leaned = lean[0] - person.lean[0], lean[1] - person.lean[1]
        moved_m = at.east - place.east_m - up_m * leaned[0], at.north - place.north_m - up_m * leaned[1]
        of_both_m2 = place.east_variance_m2 + variance_m2 + self._steady_m2
        person.parallax = person.parallax.seen_again(leaned, moved_m, variance_m2=of_both_m2)
        if person.is_proven:
            self._height_error.learn(person.parallax)
            person.parallax = NOTHING_TOLD

    def _correct_places(self) -> None:
        """Correct the places of all people by the error of the height, as it is known now."""
        up_m = self._height_error.m - self._raised_m
        self._raised_m += up_m
        for person in self._people if up_m else ():
            person.raise_by(up_m)

    def _told(self, person: PersonTrack) -> Estimate:
        return person.told(self._height_error.variance_m2)

    def on_images(
        self, count: int, shows: Callable[[Enu], bool], *, evidence: float, but: Sequence[PersonTrack] = ()
    ) -> None:
        """So many images have shown none of the people whose places they show (`shows`), except those in `but`;
        `evidence`: of one such image.
        """
        for person in self._people:
            if count and person not in but and shows(person.place.at):
                person.evidence += count * evidence

    def review(self, now_ns: int) -> list[int]:
        """Assign phones to people anew; returns the survivors who may be confirmed now, in the order of ids."""
        self._now_ns = now_ns
        self._people = [person for person in self._people if person.is_remembered(now_ns)]
        self._recognize_finds()
        for person in self._people:
            person.on_neighborhood(confirmed=self._confirmed_at(person.place.at), now_ns=now_ns)
        for survivor in self._survivors.unconfirmed():
            self._survivors.by_id[survivor].filter.on_sighting(None)
        people = [person for person in self._people if self._is_unnamed(person)]
        for person in self._people:
            person.survivor = person.survivor if person in people else None
        phones = self._phones(people)
        if not people or not phones:
            return []
        costs = [[self._cost(person.place, phone) for phone in phones] for person in people]
        _, chosen = assigned(costs, [_GATE] * len(people))
        sure = []
        for row, (person, column) in enumerate(zip(people, chosen, strict=True)):
            person.survivor = None if column is None else phones[column]
            if column is None:
                continue
            survivor = phones[column]
            known = self._survivors.by_id[survivor]
            known.filter.on_sighting(self._told(person))
            if not is_confirmable(person, known):
                continue
            required = required_margin(person, known, now_ns)
            if (margin := self._margin(costs, row, column, people)) < required:
                if is_undecided(person, margin, now_ns) and self._has_news(survivor, known):
                    self._note_among(survivor, self._carriers(costs, column, people), people)
            elif (whose := self._carriers(costs, column, people)).margin(row, within_m=_BY_SIDE_M) >= required:
                known.filter.on_sighting(_doubted(self._told(person), whose.doubt_m(row)))
                sure.append(survivor)
        return sorted(sure)

    def _has_news(self, survivor: int, known: KnownSurvivor) -> bool:
        """True, once for each `_FRESH` further powers, if it is to be computed among whom a survivor without a verdict
        is.
        """
        powers = known.filter.included_powers
        if known.settled is not None or powers < self._weighed.get(survivor, 0) + _FRESH:
            return False
        self._weighed[survivor] = powers
        return True

    def _note_among(self, survivor: int, whose: Carriers, people: Sequence[PersonTrack]) -> None:
        """Note that a survivor is among people, if they have all been seen well, are near each other, and anybody else
        is an unlikely owner.
        """
        if whose.nobody <= _ELSEWHERE and all(
            is_seen_enough(person) for person, share in zip(people, whose.shares, strict=True) if share > _ELSEWHERE
        ):
            place = whose.middle(grain_m=SAME_PLACE_M)
            if place.sigma_m <= _CROWD_M:
                self._among[survivor] = place

    def take_among(self) -> dict[int, Estimate]:
        """The survivors who are each one of several people, none of them for certain, and where those people are."""
        among, self._among = self._among, {}
        return among

    def unreported(self, now_ns: int) -> list[Estimate]:
        """The places of the people who are certainly there, seen from two places, and of whom there is no find.
        Beside a find only readings that show two people at once prove the second one.
        """
        return [
            self._told(person)
            for person in self._people
            if person.find is None
            and person.proven_ns is not None
            and now_ns - person.proven_ns >= (_UNREPORTED_NS if self._unconfirmed_near([person.place]) else _PLACED_NS)
            and person.place.sigma_m <= _SURE_M
            and (person.together >= _TOGETHER or not (person.confirmed or self._is_beside_a_find(person)))
        ]

    def _is_beside_a_find(self, person: PersonTrack) -> bool:
        return any(
            place.distance_m(person.place.at) <= SAME_PLACE_M for place in self._survivors.person_places().values()
        )

    def _is_unnamed(self, person: PersonTrack) -> bool:
        """True for a person who is not known to be a confirmed survivor."""
        named = person.find is not None and not is_person(person.find)
        return not named and (not person.confirmed or person.together >= _TOGETHER)

    def _recognize_finds(self) -> None:
        """Assign finds to people seen, one each; a survivor's comes before that of a person without a phone."""
        for person in self._people:
            person.find = None
        for finds in (self._survivors.confirmed_places(), self._survivors.person_places()):
            left = [person for person in self._people if person.find is None]
            if not left or not finds:
                continue
            chosen = paired([person.place for person in left], list(finds.values()), steady_m2=self._steady_m2)
            for person, column in zip(left, chosen, strict=True):
                person.find = None if column is None else list(finds)[column]
        self._recognize_the_lonely()

    def _recognize_the_lonely(self) -> None:
        """Assign each find that is left to a person a little farther away than usual who is seen alone."""
        taken = {person.find for person in self._people}
        finds = {find: place for find, place in self._survivors.person_places().items() if find not in taken}
        for person in self._people if finds else ():
            others = (other for other in self._people if other is not person)
            if person.find is None and all(other.place.distance_m(person.place.at) > _ALONE_M for other in others):
                near = paired([person.place], list(finds.values()), steady_m2=self._steady_m2, within_m=_ALONE_M)[0]
                person.find = None if near is None else list(finds)[near]

    def against(self, confirmed: Found) -> float:
        """By how much more the best assignment of nearby phones to people costs with a confirmed pair than without; 0
        if the best one contains it.
        """
        at = estimate_of(confirmed).at
        named = {
            survivor: place
            for survivor, known in sorted(self._survivors.by_id.items())
            if known.confirmed is not None
            and (place := known.place()) is not None
            and place.distance_m(at) <= _BESIDE_M
        }
        seen = [
            person.place
            for person in self._people
            if is_seen_enough(person) and person.place.distance_m(at) <= _BESIDE_M
            if all(place.distance_m(person.place.at) > SAME_PLACE_M for place in named.values())
        ]
        people = [*named.values(), *seen]
        phones = [*named, *self._unconfirmed_near(people)]
        costs = [[self._cost(place, phone) for phone in phones] for place in people]
        nobody = [_GATE] * len(people)
        least, _ = assigned(costs, nobody)
        row = phones.index(confirmed.survivor)
        return cost_with(costs, nobody, row, row) - least

    def _confirmed_at(self, at: Enu) -> int:
        """The number of survivors who are confirmed at this place."""
        return sum(
            known.confirmed is not None
            and (place := known.place()) is not None
            and place.distance_m(at) <= SAME_PLACE_M
            for known in self._survivors.by_id.values()
        )

    def _margin(self, costs: Sequence[Sequence[float]], row: int, column: int, people: Sequence[PersonTrack]) -> float:
        """By how much more it costs at least if neither this person nor anybody found together with it has the phone of
        a column.
        """
        at, others, nobody = people[row].place.at, [list(one) for one in costs], _nobody(people)
        for other, person in enumerate(people):
            if person.place.distance_m(at) <= _BY_SIDE_M:
                others[other][column] = IMPOSSIBLE
        return assigned(others, nobody)[0] - cost_with(costs, nobody, row, column)

    def _carriers(self, costs: Sequence[Sequence[float]], column: int, people: Sequence[PersonTrack]) -> Carriers:
        return carriers(costs, _nobody(people), column, [person.place for person in people])

    def _phones(self, people: Sequence[PersonTrack]) -> list[int]:
        """The unconfirmed survivors whose phones one of these people may carry."""
        return self._unconfirmed_near([person.place for person in people])

    def _unconfirmed_near(self, places: Sequence[Estimate]) -> list[int]:
        """The unconfirmed survivors whose phones were received near one of these places."""
        return [
            survivor
            for survivor in self._survivors.unconfirmed()
            if self._survivors.by_id[survivor].reporters
            and any(self._survivors.by_id[survivor].filter.near(place.at, within_m=_NEAR_M) for place in places)
        ]

    def _cost(self, place: Estimate, survivor: int) -> float:
        known, at = self._survivors.by_id[survivor], place.at
        doubt = _REFUTED_COST if known.was_mistaken_at(at, since_ns=self._now_ns - _DOUBTED_NS) else 0.0
        return min(IMPOSSIBLE, known.filter.deficit(at.east, at.north) + doubt)


def _lean(at: Enu, here: Enu) -> tuple[float, float]:
    """How far east and north of a position a place on the ground is, for each metre of height."""
    up_m = max(1.0, here.up)
    return (at.east - here.east) / up_m, (at.north - here.north) / up_m


def paired(
    seen: Sequence[Estimate], found: Sequence[Estimate], *, steady_m2: float, within_m: float = SAME_PLACE_M
) -> list[int | None]:
    """For each place where a person was seen, the index of the find that is of the same person, or None; each find is
    of one person.
    """
    costs = [
        [
            one.distance_m(other.at) ** 2
            / (one.east_variance_m2 + other.east_variance_m2 + other.north_variance_m2 + 2 * steady_m2)
            if one.distance_m(other.at) <= within_m
            else IMPOSSIBLE
            for other in found
        ]
        for one in seen
    ]
    return assigned(costs, [_SAME_SIGMAS * _SAME_SIGMAS] * len(seen))[1]


def _doubted(place: Estimate, doubt_m: float) -> Estimate:
    """The place with another cause of error, which is alike in all directions."""
    doubt_m2 = doubt_m * doubt_m
    return place._replace(
        east_variance_m2=place.east_variance_m2 + doubt_m2, north_variance_m2=place.north_variance_m2 + doubt_m2
    )


def _nobody(people: Sequence[PersonTrack]) -> list[float]:
    """The cost that each of these people carries none of the phones; greater for one who is certainly there."""
    return [_GATE + GREATEST_MARGIN * person.is_proven for person in people]
