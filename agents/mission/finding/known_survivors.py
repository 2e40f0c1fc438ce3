"""What one UAV knows of the survivors: which nodes reported each one, where each one is, and which are confirmed.

A refutation takes back confirmations of the same place that are not younger than itself, in whatever order they arrive,
and the best announced estimate unless that is younger. Of two confirmations that nothing refutes, the first to arrive
stays. The phones of confirmed survivors calibrate those of the others (`calibration.py`).
"""

from dataclasses import dataclass, field
from typing import Final, NamedTuple, assert_never

from agents.mission.finding.calibration import common_offset, likelihood
from agents.mission.finding.looked_at import LookedAt
from agents.mission.finding.phone_localization import AS_ASSUMED, Estimate, PhoneFilter, PhoneModel, PhoneOffset
from fanet_mw.units import US, Enu, S
from fanet_mw.wire.survivors import Found, Standing, Survivor, is_person

_PASSED_ON: Final = 5
"""The greatest number of reports in one hello."""
_FRESH_NS: Final = 8 * S
"""Hellos pass on reports that are not older than this, whoever made them."""
SAME_PLACE_M: Final = 12.0
"""Two sightings, or two confirmations, at no more than this distance are of one place."""
_MOST_PERSONS: Final = 2000
"""The greatest number of people without a phone that are remembered."""
_MOST_REFUTED: Final = 4
"""The greatest number of refutations of one survivor that are kept, the youngest ones."""


@dataclass
class KnownSurvivor:
    """What one UAV knows of one survivor."""

    filter: PhoneFilter
    """Estimates the phone's place, from this UAV's received powers and those in the reports of other nodes."""
    reporters: set[int] = field(default_factory=set)
    latest: dict[int, Survivor] = field(default_factory=dict)
    first_ns: int = 0
    announced: Found | None = None
    """The most exact estimate that another node has announced."""
    settled: Found | None = None
    """The most exact verdict that the survivor is inside a building, or among people seen: nobody need fly there."""
    confirmed: Found | None = None
    looked_at: LookedAt = field(default_factory=LookedAt)
    """Where cameras have looked, for any survivor."""
    refuted: list[Found] = field(default_factory=list)
    """The refutations of this survivor, each with the place that was confirmed by mistake, oldest first."""
    _elsewhere: tuple[tuple[Estimate, int], Estimate] | None = None
    """The place where cameras have not looked, by which estimate and by what they had shown when it was computed."""

    @property
    def verdict(self) -> Found | None:
        """The confirmation that holds, otherwise the building or the people, otherwise the latest refutation."""
        return self.confirmed or self.settled or (self.refuted[-1] if self.refuted else None)

    def is_refuted(self, found: Found) -> bool:
        """True for a confirmation that a known refutation takes back."""
        return any(_refutes(refuted, found) for refuted in self.refuted)

    def was_mistaken_at(self, at: Enu, *, since_ns: int) -> bool:
        """True if a confirmation of the survivor at this place was refuted after an instant."""
        return any(
            refuted.t_us * US >= since_ns and estimate_of(refuted).distance_m(at) <= SAME_PLACE_M
            for refuted in self.refuted
        )

    def is_heard_within(self, sigma_m: float) -> bool:
        """True if received powers alone give the place of the phone with at most this standard deviation."""
        heard = self.filter.estimate_by_power()
        return heard is not None and heard.sigma_m <= sigma_m

    def place(self) -> Estimate | None:
        """The confirmed place, otherwise the more exact one of this UAV's estimate and the announced one; that one does
        not count once cameras have looked there. None if there is none.
        """
        if self.confirmed is not None:
            return estimate_of(self.confirmed)
        own = self.own_place()
        if self.announced is None:
            return own
        announced = estimate_of(self.announced)
        if own is not None and self.looked_at.has_shown(announced.east_m, announced.north_m):
            return own
        return announced if own is None or announced.sigma_m < own.sigma_m else own

    def own_place(self) -> Estimate | None:
        """The filter's place; if cameras have looked there and nobody was recognized, where else the phone may be."""
        own = self.filter.estimate()
        if own is None or self.filter.is_seen or not self.looked_at.has_shown(own.east_m, own.north_m):
            return own
        if self._elsewhere is None or self._elsewhere[0] != (own, self.looked_at.second):
            self._elsewhere = (own, self.looked_at.second), self.filter.estimate_elsewhere(self.looked_at.has_shown)
        return self._elsewhere[1]


class PhoneLikelihood(NamedTuple):
    """The likelihood of each common offset, given the powers of one confirmed survivor's phone."""

    found: Found
    readings: int
    values: tuple[float, ...]


class KnownSurvivors:
    """All survivors that one UAV has heard of, by id."""

    def __init__(self, model: PhoneModel, looked_at: LookedAt | None = None) -> None:
        """`looked_at`: where cameras have looked; None for a node without any."""
        self._model, self._looked_at = model, looked_at or LookedAt()
        self.by_id: dict[int, KnownSurvivor] = {}
        self.persons: dict[int, Found] = {}
        """The latest verdict on each person who was found without a phone: found, or given up."""
        self._likelihoods: dict[int, PhoneLikelihood] = {}
        self.offset: PhoneOffset = AS_ASSUMED
        """The offset common to all phones, as estimated from the phones of all confirmed survivors."""

    def take_report(self, report: Survivor, *, now_ns: int) -> KnownSurvivor:
        """Take in a report, which holds the power with which this UAV or another node has received a phone."""
        known = self.by_id.get(report.survivor)
        if known is None:
            known = self._first_heard(report.survivor, now_ns)
        before = known.latest.get(report.reporter)
        if before == report:
            return known  # several neighbors pass the same report on
        if before is None or report.t_us > before.t_us:
            known.latest[report.reporter] = report
        known.reporters.add(report.reporter)
        known.filter.on_rssi(report.reporter, report.position, report.rssi_dbm)
        return known

    def on_found(self, found: Found, *, now_ns: int) -> bool:
        """Take in an announcement; True for a verdict that changes something: it confirms an unconfirmed survivor,
        takes the confirmation back, or is the first by which nobody need fly there.
        """
        if is_person(found.survivor):
            return self._on_person(found)
        known = self.by_id.get(found.survivor)
        if known is None:
            known = self._first_heard(found.survivor, now_ns)
        match found.standing:
            case Standing.CONFIRMED:
                fresh = known.confirmed is None and not known.is_refuted(found)
                if fresh:
                    known.confirmed = found
                    self._calibrate()
                return fresh
            case Standing.REFUTED:
                reopened = _refute(known, found)
                if reopened:
                    self._calibrate()
                return reopened
            case Standing.INSIDE | Standing.AMONG:
                first = known.settled is None
                if known.settled is None or estimate_of(found).sigma_m < estimate_of(known.settled).sigma_m:
                    known.settled = found
                return first and known.confirmed is None
            case Standing.ESTIMATED:
                outdated = any(found.t_us <= refuted.t_us for refuted in known.refuted)
                best = known.announced
                if not outdated and (best is None or _is_better(found, best)):
                    known.announced = found
                return False
            case _:
                assert_never(found.standing)

    def _on_person(self, found: Found) -> bool:
        """Take in that a person without a phone was found, or given up, which holds for ever; True if that is news."""
        before = self.persons.get(found.survivor)
        if before is None and len(self.persons) >= _MOST_PERSONS:
            return False
        if before is not None and (before.standing is Standing.REFUTED or found.standing is Standing.CONFIRMED):
            return False
        self.persons[found.survivor] = found
        return True

    def verdict(self, survivor: int) -> Found | None:
        """The verdict on a survivor or a person that holds (`KnownSurvivor.verdict`); None without any."""
        if is_person(survivor):
            return self.persons.get(survivor)
        known = self.by_id.get(survivor)
        return None if known is None else known.verdict

    def is_outdated(self, found: Found) -> bool:
        """True for a confirmation that a known refutation takes back."""
        if found.standing is not Standing.CONFIRMED:
            return False
        if is_person(found.survivor):
            verdict = self.persons.get(found.survivor)
            return verdict is not None and verdict.standing is Standing.REFUTED
        return self.by_id[found.survivor].is_refuted(found)

    def confirmed_places(self) -> dict[int, Estimate]:
        return {
            survivor: estimate_of(known.confirmed)
            for survivor, known in sorted(self.by_id.items())
            if known.confirmed is not None
        }

    def person_places(self) -> dict[int, Estimate]:
        return {
            person: estimate_of(found)
            for person, found in sorted(self.persons.items())
            if found.standing is Standing.CONFIRMED
        }

    def unconfirmed(self) -> list[int]:
        """The survivors without a confirmation that holds, in order of id."""
        return sorted([survivor for survivor, known in self.by_id.items() if known.confirmed is None])

    def sought(self) -> list[int]:
        """The unconfirmed survivors to whom UAVs fly: not those who are inside a building or among people."""
        return [survivor for survivor in self.unconfirmed() if self.by_id[survivor].settled is None]

    def is_confirmed(self, survivor: int) -> bool:
        known = self.by_id.get(survivor)
        return known is not None and known.confirmed is not None

    def is_found(self, survivor: int) -> bool:
        """True if nobody need fly to the survivor any more, who is confirmed, inside a building or among people."""
        known = self.by_id.get(survivor)
        return known is not None and (known.confirmed is not None or known.settled is not None)

    def recent_reports(self, *, now_ns: int) -> list[Survivor]:
        """The reports of unconfirmed survivors to pass on with the next hello, newest first."""
        fresh = [
            report
            for survivor in self.unconfirmed()
            for report in self.by_id[survivor].latest.values()
            if now_ns - report.t_us * US <= _FRESH_NS
        ]
        fresh.sort(key=lambda report: (-report.t_us, report.survivor, report.reporter))
        return fresh[:_PASSED_ON]

    def _first_heard(self, survivor: int, now_ns: int) -> KnownSurvivor:
        known = self.by_id[survivor] = KnownSurvivor(
            PhoneFilter(self._model, self.offset), looked_at=self._looked_at, first_ns=now_ns
        )
        return known

    def _calibrate(self) -> None:
        """Estimate the common offset from confirmed survivors' phones, and calibrate all other filters by it."""
        before, self._likelihoods = self._likelihoods, {}
        for survivor, known in sorted(self.by_id.items()):
            if known.confirmed is None:
                continue
            readings = known.filter.readings
            phone = before.get(survivor)
            if phone is None or phone.found != known.confirmed or phone.readings != len(readings):
                values = likelihood(estimate_of(known.confirmed), readings, self._model)
                phone = PhoneLikelihood(known.confirmed, len(readings), values)
            self._likelihoods[survivor] = phone
        self.offset = common_offset(phone.values for phone in self._likelihoods.values())
        for survivor in self.unconfirmed():
            self.by_id[survivor].filter.calibrate(self.offset)


def _refute(known: KnownSurvivor, refuted: Found) -> bool:
    """Take in a refutation; True if it takes the present confirmation back."""
    if not any(_refutes(one, refuted) for one in known.refuted):
        known.refuted = sorted([*known.refuted, refuted], key=lambda one: (one.t_us, one.node))[-_MOST_REFUTED:]
    if known.announced is not None and known.announced.t_us <= refuted.t_us:
        known.announced = None
    if known.confirmed is None or not _refutes(refuted, known.confirmed):
        return False
    known.confirmed = None
    known.filter.on_sighting(None)
    return True


def _is_better(found: Found, best: Found) -> bool:
    """True for a more exact estimate, or for what the same node has learned since."""
    learned = found.node == best.node and found.t_us > best.t_us
    return learned or estimate_of(found).sigma_m < estimate_of(best).sigma_m


def _refutes(refuted: Found, found: Found) -> bool:
    """True if `refuted` is not older than `found` and of the same place; it then takes `found` back."""
    at = estimate_of(found).at
    return found.t_us <= refuted.t_us and estimate_of(refuted).distance_m(at) <= SAME_PLACE_M


def estimate_of(found: Found) -> Estimate:
    return Estimate(found.east_m, found.north_m, found.east_variance_m2, found.covariance_m2, found.north_variance_m2)
