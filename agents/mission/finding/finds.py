"""What one UAV knows of the survivors: which nodes reported each, where each is, and which are confirmed.

heard by a phone's signal -> reported by enough different nodes -> seen at close range -> confirmed: struck off
confirmed, and heard since where it cannot be heard from the confirmed place           -> refuted: open again

A confirmation and what refutes it are merged in any order to the same result: a refutation takes back the
confirmations of the same place, and all estimates, that are not younger than it.

What has been heard of the confirmed tells how strong phones are, and calibrates the filters of those that are open.
"""

import math
from dataclasses import dataclass, field
from typing import Final, NamedTuple, assert_never

from agents.mission.finding.calibration import common_offset, likelihood
from agents.mission.finding.phone_filter import AS_ASSUMED, Estimate, PhoneFilter, PhoneModel, PhoneOffset
from fanet_mw.units import US, Enu, S
from fanet_mw.wire.inner import Survivor
from fanet_mw.wire.search import Found, Standing

_PASSED_ON: Final = 5
"""The most reports in one hello."""
_FRESH_NS: Final = 8 * S
"""A node that did not make a report itself passes it on while it is younger than this."""
SAME_PLACE_M: Final = 12.0
"""Two sightings, or two confirmations, nearer to each other than this are of one place."""
_MOST_REFUTED: Final = 4
"""The most mistaken places of one survivor that are kept in mind, the youngest ones."""


@dataclass
class Find:
    """What one UAV knows of one survivor."""

    filter: PhoneFilter
    reporters: set[int] = field(default_factory=set)
    latest: dict[int, Survivor] = field(default_factory=dict)
    """The newest report of each node."""
    first_ns: int = 0
    told: Found | None = None
    """The best estimate that another node has told."""
    confirmed: Found | None = None
    refuted: list[Found] = field(default_factory=list)
    """The places at which it was confirmed by mistake, each with the instant of its refutation, oldest first."""

    @property
    def verdict(self) -> Found | None:
        """The confirmation that holds, or the latest refutation; None when nobody has announced anything."""
        return self.confirmed or (self.refuted[-1] if self.refuted else None)

    def is_refuted(self, found: Found) -> bool:
        """True for a confirmation that has been taken back."""
        return any(_refutes(refuted, found) for refuted in self.refuted)

    def doubted(self, at: Enu) -> bool:
        """True at a place at which the survivor was confirmed by mistake."""
        return any(estimate_of(refuted).distance_m(at) <= SAME_PLACE_M for refuted in self.refuted)

    def place(self) -> Estimate | None:
        """The better one of the estimate from this UAV's samples and the best that another node has told."""
        if self.confirmed is not None:
            return estimate_of(self.confirmed)
        own = self.filter.estimate()
        if self.told is None:
            return own
        told = estimate_of(self.told)
        return told if own is None or told.sigma_m < own.sigma_m else own


class PhoneLikelihood(NamedTuple):
    """What one phone tells of the common offset, with the confirmation and the number of powers it was computed of."""

    found: Found
    readings: int
    values: tuple[float, ...]


class Finds:
    """All survivors that one UAV has heard of, by id."""

    def __init__(self, model: PhoneModel) -> None:
        self._model = model
        self.known: dict[int, Find] = {}
        self._likelihoods: dict[int, PhoneLikelihood] = {}
        """For each confirmed survivor, what has been heard of that phone says of the offset common to all phones."""
        self.offset: PhoneOffset = AS_ASSUMED
        """What the phones of confirmed survivors tell of the offset common to all phones."""

    def report(self, report: Survivor, *, now_ns: int) -> Find:
        """Take in a received power that this UAV or another node has measured."""
        find = self.known.get(report.survivor)
        if find is None:
            find = self._opened(report.survivor, now_ns)
        before = find.latest.get(report.reporter)
        if before is None or report.t_us > before.t_us:
            find.latest[report.reporter] = report
        find.reporters.add(report.reporter)
        find.filter.on_rssi(report.reporter, report.position, report.rssi_dbm)
        return find

    def on_found(self, found: Found, *, now_ns: int) -> bool:
        """Take in what is told of a survivor; True if it strikes the survivor off, or opens it again."""
        find = self.known.get(found.survivor)
        if find is None:
            find = self._opened(found.survivor, now_ns)
        match found.standing:
            case Standing.CONFIRMED:
                fresh = find.confirmed is None and not find.is_refuted(found)
                if fresh:
                    find.confirmed = found
                    self._calibrate()
                return fresh
            case Standing.REFUTED:
                reopened = _refute(find, found)
                if reopened:
                    self._calibrate()
                return reopened
            case Standing.ESTIMATED:
                outdated = any(found.t_us <= refuted.t_us for refuted in find.refuted)
                if not outdated and (find.told is None or estimate_of(found).sigma_m < estimate_of(find.told).sigma_m):
                    find.told = found
                return False
            case _:
                assert_never(found.standing)

    def open(self) -> list[int]:
        """The survivors that wait to be confirmed, in order of id."""
        return sorted(survivor for survivor, find in self.known.items() if find.confirmed is None)

    def is_confirmed(self, survivor: int) -> bool:
        """True if a node has confirmed the survivor."""
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

    def _opened(self, survivor: int, now_ns: int) -> Find:
        find = self.known[survivor] = Find(PhoneFilter(self._model, self.offset), first_ns=now_ns)
        return find

    def _calibrate(self) -> None:
        """Estimate the common offset from those who are confirmed now, and tell the filters of all others."""
        before, self._likelihoods = self._likelihoods, {}
        for survivor, find in sorted(self.known.items()):
            if find.confirmed is None:
                continue
            readings = find.filter.readings
            known = before.get(survivor)
            if known is None or known.found != find.confirmed or known.readings != len(readings):
                values = likelihood(estimate_of(find.confirmed), readings, self._model)
                known = PhoneLikelihood(find.confirmed, len(readings), values)
            self._likelihoods[survivor] = known
        self.offset = common_offset(phone.values for phone in self._likelihoods.values())
        for survivor in self.open():
            self.known[survivor].filter.calibrate(self.offset)


def _refute(find: Find, refuted: Found) -> bool:
    """Take in a refutation; True if it opens the survivor again."""
    if not any(_refutes(known, refuted) for known in find.refuted):
        find.refuted = sorted([*find.refuted, refuted], key=lambda one: (one.t_us, one.node))[-_MOST_REFUTED:]
    if find.told is not None and find.told.t_us <= refuted.t_us:
        find.told = None
    if find.confirmed is None or not _refutes(refuted, find.confirmed):
        return False
    find.confirmed = None
    find.filter.on_sighting(None)
    return True


def _refutes(refuted: Found, found: Found) -> bool:
    """True if a refutation takes back this confirmation, or holds as much as this refutation."""
    at = estimate_of(found).at
    return found.t_us <= refuted.t_us and estimate_of(refuted).distance_m(at) <= SAME_PLACE_M


def estimate_of(found: Found) -> Estimate:
    """The place that is told of a survivor."""
    return Estimate(found.east_m, found.north_m, found.east_variance_m2, found.covariance_m2, found.north_variance_m2)


def ground_place(at: Enu, *, bearing_rad: float, elevation_rad: float) -> tuple[float, float, float] | None:
    """East and north of the ground in the direction of a sensor, and the slant range; None above the horizon."""
    if elevation_rad >= -0.05:
        return None
    along_m = at.up / math.tan(-elevation_rad)
    return (
        at.east + along_m * math.sin(bearing_rad),
        at.north + along_m * math.cos(bearing_rad),
        math.hypot(along_m, at.up),
    )
