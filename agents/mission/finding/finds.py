"""What one UAV knows of the survivors: which nodes reported each, where each is, and which are confirmed.

heard by a phone's signal -> reported by enough different nodes -> seen at close range -> confirmed: struck off
"""

import math
from dataclasses import dataclass, field
from typing import Final

from agents.mission.finding.phone_filter import Estimate, PhoneFilter, PhoneModel
from fanet_mw.units import US, Enu, S
from fanet_mw.wire.inner import Survivor
from fanet_mw.wire.search import Found

_PASSED_ON: Final = 5
"""The most reports in one hello."""
_FRESH_NS: Final = 8 * S
"""A node that did not make a report itself passes it on while it is younger than this."""


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

    def place(self) -> Estimate | None:
        """The better one of the estimate from this UAV's samples and the best that another node has told."""
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

    def report(self, report: Survivor, *, now_ns: int) -> Find:
        """Take in a received power that this UAV or another node has measured."""
        find = self.known.get(report.survivor)
        if find is None:
            find = self.known[report.survivor] = Find(PhoneFilter(self._model), first_ns=now_ns)
        before = find.latest.get(report.reporter)
        if before is None or report.t_us > before.t_us:
            find.latest[report.reporter] = report
        find.reporters.add(report.reporter)
        if find.confirmed is None:
            find.filter.on_rssi(report.reporter, report.position, report.rssi_dbm)
        return find

    def on_found(self, found: Found, *, now_ns: int) -> bool:
        """Take in an estimate or a confirmation of another node; True if it strikes the survivor off."""
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


def _estimate(found: Found) -> Estimate:
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
