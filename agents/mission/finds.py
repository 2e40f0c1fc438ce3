"""What one UAV knows of the survivors: who reported each, where each is estimated to be, and who is confirmed.

heard by a phone's signal -> reported by enough different nodes -> seen at close range -> confirmed: struck off
"""

import math
from dataclasses import dataclass, field
from typing import Final

from agents.mission.phone_filter import REFERENCE_LOSS_DB, Estimate, PhoneFilter, PhoneModel
from fanet_mw.units import US, Enu, S
from fanet_mw.wire.inner import Survivor
from fanet_mw.wire.search import Found

_GATE: Final = 16.0
"""A sighting less likely than this by what was heard of a phone is not of its owner: twice a difference of logarithms.
Above 11.8, the 99.7 % of chi-square with 2 degrees: the shadowing of neighboring samples is not independent."""
_VAGUE_M: Final = 80.0
"""A phone whose place has a larger standard deviation than this could be anybody's."""
_SURE_OF_TAKEN_M: Final = 30.0
"""The same where somebody has been confirmed already."""
_GATE_TAKEN: Final = 6.0
"""The gate where somebody has been confirmed already: most likely that one again, but two may lie side by side."""
_SAMPLES: Final = 6
_REPORTERS: Final = 2
"""Fewer received powers, or by fewer nodes, do not tell whose phone it is."""
_SAMPLES_ALONE: Final = 8
"""As many by one node do: it has passed by, and at the edge of the area nobody else may ever hear that phone."""
_SAME_PERSON_M: Final = 12.0
"""Sightings nearer to each other than this are of one person."""
_OLD_SIGHTING_NS: Final = 5 * S
_PASSED_ON: Final = 5
"""Reports of one hello."""
_FRESH_NS: Final = 8 * S
"""Reports younger than this are passed on by those who only heard of them."""


@dataclass
class Find:
    """One survivor."""

    filter: PhoneFilter
    reporters: set[int] = field(default_factory=set)
    latest: dict[int, Survivor] = field(default_factory=dict)
    """The newest report of each node."""
    first_ns: int = 0
    own_heard_ns: int | None = None
    """When our own receiver last heard the phone."""
    own_rssi_dbm: float = 0.0
    sightings: int = 0
    told: Found | None = None
    """The best estimate that another node has told."""
    confirmed: Found | None = None

    def place(self) -> Estimate | None:
        """The better of what we have measured and what another node has told."""
        if self.confirmed is not None:
            return _estimate(self.confirmed)
        own = self.filter.estimate()
        if self.told is None:
            return own
        told = _estimate(self.told)
        return told if own is None or told.sigma_m < own.sigma_m else own


class Finds:
    """All survivors that one UAV has heard of, by id."""

    def __init__(self, model: PhoneModel) -> None:
        self._model = model
        self.known: dict[int, Find] = {}

    def report(self, report: Survivor, *, now_ns: int, own: bool) -> Find:
        """A received power that we or another node measured."""
        find = self.known.get(report.survivor)
        if find is None:
            find = self.known[report.survivor] = Find(PhoneFilter(self._model), first_ns=now_ns)
        if own:
            find.own_heard_ns, find.own_rssi_dbm = now_ns, report.rssi_dbm
        before = find.latest.get(report.reporter)
        if before is None or report.t_us > before.t_us:
            find.latest[report.reporter] = report
        find.reporters.add(report.reporter)
        if find.confirmed is None:
            find.filter.heard(report.reporter, report.position, report.rssi_dbm)
        return find

    def told(self, found: Found, *, now_ns: int) -> bool:
        """Another node's estimate or confirmation; whether the survivor is struck off by it."""
        find = self.known.get(found.survivor)
        if find is None:
            find = self.known[found.survivor] = Find(PhoneFilter(self._model), first_ns=now_ns)
        if found.confirmed:
            fresh = find.confirmed is None
            if fresh:
                find.confirmed = found
            return fresh
        if find.told is None or _estimate(found).sigma_m < _estimate(find.told).sigma_m:
            find.told = found
        return False

    def seen(self, at: Enu, *, by: Enu, sigma_m: float, now_ns: int) -> int | None:
        """Somebody was seen on the ground, by a camera that names nobody; the survivor who that is taken to be."""
        east_m, north_m = at.east, at.north
        best: tuple[float, int] | None = None
        taken = any(
            find.confirmed is not None and _estimate(find.confirmed).distance_m(at) <= _SAME_PERSON_M
            for find in self.known.values()
        )
        gate = _GATE_TAKEN if taken else _GATE
        for survivor, find in self.known.items():
            if find.confirmed is not None or find.own_heard_ns is None or now_ns - find.own_heard_ns > _OLD_SIGHTING_NS:
                continue
            place = find.place()
            if place is None or place.sigma_m > (_SURE_OF_TAKEN_M if taken else _VAGUE_M):
                continue
            if find.filter.is_seen:
                if place.distance_m(at) > _SAME_PERSON_M:
                    continue
                score = 0.0
            else:
                score = find.filter.deficit(east_m, north_m) + self._surprise(find, by, at)
            if score <= gate:
                best = (score, survivor) if best is None else min(best, (score, survivor))
        if best is None:
            return None
        find = self.known[best[1]]
        if find.confirmed is None:
            find.filter.seen(east_m, north_m, sigma_m=sigma_m)
            find.sightings += 1
        return best[1]

    def borne_out(self, survivor: int) -> bool:
        """Whether what was heard of a phone suffices to say that its owner is who was seen; who is not is forgotten."""
        find = self.known[survivor]
        place = find.filter.estimate()
        if place is None or not find.filter.is_seen:
            return False
        deficit = find.filter.deficit(place.east_m, place.north_m)
        if deficit > _GATE:
            find.filter.unsee()
            find.sightings = 0
            return False
        enough = _SAMPLES if len(find.reporters) >= _REPORTERS else _SAMPLES_ALONE
        return find.filter.samples >= enough

    def _surprise(self, find: Find, by: Enu, at: Enu) -> float:
        """How little the power that we hear of a phone fits somebody at a place: the squared deviation in sigmas."""
        model = self._model
        distance_m = max(1.0, by.minus(at).norm())
        expected_dbm = model.power_dbm - REFERENCE_LOSS_DB - 10 * model.exponent * math.log10(distance_m)
        variance = max(model.shadowing_db, 1.0) ** 2 + model.offset_db**2
        return (find.own_rssi_dbm - expected_dbm) ** 2 / variance

    def open(self) -> list[int]:
        """The survivors that wait to be confirmed, in order of id."""
        return sorted(survivor for survivor, find in self.known.items() if find.confirmed is None)

    def is_confirmed(self, survivor: int) -> bool:
        """Whether somebody has confirmed a survivor."""
        find = self.known.get(survivor)
        return find is not None and find.confirmed is not None

    def news(self, *, now_ns: int) -> list[Survivor]:
        """The latest reports to pass on to neighbors, newest first."""
        fresh = [
            report
            for survivor in self.open()
            for report in self.known[survivor].latest.values()
            if now_ns - report.t_us * US <= _FRESH_NS
        ]
        fresh.sort(key=lambda report: (-report.t_us, report.survivor, report.reporter))
        return fresh[:_PASSED_ON]


def _estimate(found: Found) -> Estimate:
    return Estimate(found.east_m, found.north_m, found.east_variance_m2, found.covariance_m2, found.north_variance_m2)


def ground_place(at: Enu, *, bearing_rad: float, elevation_rad: float) -> tuple[float, float, float] | None:
    """East and north of the ground at which a sensor looks, and the slant range; None above the horizon."""
    if elevation_rad >= -0.05:
        return None
    along_m = at.up / math.tan(-elevation_rad)
    return (
        at.east + along_m * math.sin(bearing_rad),
        at.north + along_m * math.cos(bearing_rad),
        math.hypot(along_m, at.up),
    )
