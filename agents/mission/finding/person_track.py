"""One person on the ground whom cameras or microphones show: a Kalman filter over the sightings of this person."""

from dataclasses import dataclass
from typing import Final

from agents.mission.finding.phone_localization import Estimate
from fanet_mw.units import Enu, S

_FORGOTTEN_NS: Final = 60 * S
"""A person of whom there was no further sighting for this long is forgotten."""
_FALSE_ALARM_NS: Final = 10 * S
"""A single sighting without another one within this time was a false alarm."""
_SECOND_SIGHTINGS: Final = 20
"""A second person at a place where a survivor is confirmed is believed after this number of further sightings."""


@dataclass
class PersonTrack:
    """One person, by the sightings so far."""

    place: Estimate
    first_ns: int
    last_ns: int
    sightings: int = 1
    close_sightings: int = 0
    """The number of sightings from close by."""
    survivor: int | None = None
    """The survivor whose phone was last assigned to this person."""
    confirmed_at: int | None = None
    """The number of sightings at which a survivor was found to be confirmed at this place; None if none is."""

    def on_sighting(self, at: Enu, variance_m2: float, now_ns: int) -> None:
        """Add a sighting, by a Kalman filter with the same variance along each axis."""
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

    def on_neighborhood(self, *, confirmed: bool, refuted: bool, now_ns: int) -> None:
        """Note whether a survivor is confirmed at this place now, and whether a confirmation here was taken back.

        From the moment of a confirmation, only further sightings show that a second person lies here.
        """
        if confirmed and self.confirmed_at is None:
            self.confirmed_at, self.first_ns = self.sightings, now_ns
        elif refuted and not confirmed:
            self.confirmed_at = None

    @property
    def is_believed(self) -> bool:
        """False if this may be only the survivor who is confirmed at this place already."""
        return self.confirmed_at is None or self.sightings - self.confirmed_at >= _SECOND_SIGHTINGS

    def is_remembered(self, now_ns: int) -> bool:
        """True while this person has been seen recently enough; a single sighting is forgotten sooner."""
        return now_ns - self.last_ns <= (_FORGOTTEN_NS if self.sightings > 1 else _FALSE_ALARM_NS)
