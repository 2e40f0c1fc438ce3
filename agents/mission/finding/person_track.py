"""People at one place on the ground whom cameras or microphones show, mostly one: a Kalman filter over the sightings.

However often one person is seen, only people whom the same reading of a sensor shows are several.
"""

from dataclasses import dataclass, field
from typing import Final

from agents.mission.finding.phone_localization import Estimate
from fanet_mw.units import Enu, S

_FORGOTTEN_NS: Final = 60 * S
"""A person of whom there was no further sighting for this long is forgotten."""
_FALSE_ALARM_NS: Final = 10 * S
"""A single sighting without another one within this time was a false alarm."""
_TOGETHER: Final = 2
"""Several people are believed to be at one place after this number of readings that showed as many; in a single one a
false alarm may stand beside a person."""


@dataclass
class PersonTrack:
    """The people at one place, by the sightings so far."""

    place: Estimate
    first_ns: int
    last_ns: int
    sightings: int = 1
    close_sightings: int = 0
    """The number of sightings from close by."""
    survivor: int | None = None
    """The survivor whose phone was last assigned to this person."""
    confirmed: int = 0
    """The number of survivors who are confirmed at this place."""
    shown_by: tuple[str, int] | None = None
    """The sensor and the instant of the latest sighting, which are the same for all that one reading shows."""
    in_reading: int = 1
    """How many sightings of this place the latest reading has brought so far."""
    readings: list[int] = field(default_factory=list)
    """The number of readings that have shown at least two people here, three, and so on."""

    def on_sighting(self, at: Enu, variance_m2: float, shown_by: tuple[str, int]) -> None:
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
        self.in_reading = self.in_reading + 1 if shown_by == self.shown_by else 1
        self.shown_by, self.last_ns = shown_by, shown_by[1]
        if self.in_reading > 1:
            self.readings += [0] * (self.in_reading - 1 - len(self.readings))
            self.readings[self.in_reading - 2] += 1

    def on_neighborhood(self, *, confirmed: int, now_ns: int) -> None:
        """Note how many survivors are confirmed at this place now."""
        if confirmed and not self.confirmed:
            self.first_ns = now_ns
        self.confirmed = confirmed

    @property
    def unnamed(self) -> int:
        """The number of people here who are not known to be confirmed."""
        people = 1 + sum(count >= _TOGETHER for count in self.readings)
        return max(0, people - self.confirmed)

    def is_remembered(self, now_ns: int) -> bool:
        """True while this person has been seen recently enough; a single sighting is forgotten sooner."""
        return now_ns - self.last_ns <= (_FORGOTTEN_NS if self.sightings > 1 else _FALSE_ALARM_NS)
