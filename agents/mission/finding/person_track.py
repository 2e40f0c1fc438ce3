"""One person whom cameras or microphones show: a Kalman filter over the sightings, and the evidence of presence."""

from dataclasses import dataclass
from typing import Final

from agents.mission.finding.height_error import NOTHING_TOLD, Parallax
from agents.mission.finding.phone_localization import Estimate
from fanet_mw.units import Enu, S

_FORGOTTEN_NS: Final = 60 * S
"""A person of whom there was no further sighting for this long is forgotten."""
_FALSE_ALARM_NS: Final = 10 * S
"""A single sighting without another one within this time was a false alarm."""
_MOST_EVIDENCE: Final = 40.0
_GONE: Final = -7.0
"""With less evidence than this nobody is there, or no longer."""
_PROVEN: Final = 18.0
"""The evidence by which a person is there: e^-18 of all false alarms would come as far."""
_BASE_M: Final = 8.0
"""A person was seen from two places if they are at least this far apart."""
_SIGHTINGS: Final = 2
"""A person is not proven before this number of sightings."""


@dataclass
class PersonTrack:
    """One person, by the sightings so far."""

    place: Estimate
    first_ns: int
    last_ns: int
    seen_from: Enu
    """The position of the UAV at the first sighting."""
    evidence: float
    lean: tuple[float, float] = (0.0, 0.0)
    """The mean direction of the sightings: how far east and north for each metre down (`height_error.py`)."""
    parallax: Parallax = NOTHING_TOLD
    """What the sightings tell of the UAV's height that has not been taken in yet."""
    sightings: int = 1
    close_sightings: int = 0
    base_m: float = 0.0
    """The greatest distance of the UAV's positions at a sighting from that at the first one."""
    together: int = 0
    """The number of readings that have shown somebody else beside this person."""
    survivor: int | None = None
    """The survivor whose phone was last assigned to this person."""
    find: int | None = None
    """The find that is of this person: the id of a confirmed survivor, or of a person without a phone."""
    confirmed: int = 0
    """The number of survivors who are confirmed at this place."""
    proven_ns: int | None = None
    """The instant from which it was certain that somebody is there."""

    def on_sighting(
        self,
        at: Enu,
        variance_m2: float,
        *,
        here: Enu,
        evidence: float,
        now_ns: int,
        lean: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Add a sighting from a position of the UAV, by a Kalman filter with the same variance along each axis."""
        before = self.place
        gain = before.east_variance_m2 / (before.east_variance_m2 + variance_m2)
        east, north = self.lean
        self.lean = east + gain * (lean[0] - east), north + gain * (lean[1] - north)
        self.place = Estimate(
            before.east_m + gain * (at.east - before.east_m),
            before.north_m + gain * (at.north - before.north_m),
            before.east_variance_m2 * (1 - gain),
            0.0,
            before.north_variance_m2 * (1 - gain),
        )
        self.sightings += 1
        self.last_ns = now_ns
        self.evidence = min(_MOST_EVIDENCE, self.evidence + evidence)
        self.base_m = max(self.base_m, here.horizontal_to(self.seen_from))

    def raise_by(self, up_m: float) -> None:
        """The UAV has been so much higher than was taken at the sightings so far."""
        east_m, north_m = self.place.east_m + up_m * self.lean[0], self.place.north_m + up_m * self.lean[1]
        self.place = self.place._replace(east_m=east_m, north_m=north_m)

    def told(self, height_variance_m2: float) -> Estimate:
        """The place, with the uncertainty of the UAV's height."""
        (east, north), place = self.lean, self.place
        return place._replace(
            east_variance_m2=place.east_variance_m2 + height_variance_m2 * east * east,
            covariance_m2=place.covariance_m2 + height_variance_m2 * east * north,
            north_variance_m2=place.north_variance_m2 + height_variance_m2 * north * north,
        )

    def distance2(self, at: Enu, variance_m2: float) -> float:
        """The squared distance of a sighting from this person, in variances of both."""
        return self.place.distance_m(at) ** 2 / (variance_m2 + self.place.east_variance_m2)

    def on_neighborhood(self, *, confirmed: int, now_ns: int) -> None:
        if confirmed and not self.confirmed:
            self.first_ns = now_ns
        self.confirmed = confirmed
        if self.proven_ns is None and self.is_proven and self.base_m >= _BASE_M:
            self.proven_ns = now_ns

    @property
    def is_proven(self) -> bool:
        return self.evidence >= _PROVEN and self.sightings >= _SIGHTINGS

    def is_remembered(self, now_ns: int) -> bool:
        """True while this person has been seen recently enough; a single sighting is forgotten sooner."""
        lasts_ns = _FORGOTTEN_NS if self.sightings > 1 else _FALSE_ALARM_NS
        return self.evidence > _GONE and now_ns - self.last_ns <= lasts_ns
