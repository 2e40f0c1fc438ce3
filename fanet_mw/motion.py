"""A motion: where something is at an instant, and how fast it moves. Pure geometry."""

from typing import Final, NamedTuple

from fanet_mw.units import Enu, S

_new: Final = tuple.__new__  # faster than the constructor, for vectors that are computed all the time


class Motion(NamedTuple):
    """A position, the velocity there [m/s], and the instant of both."""

    position: Enu
    velocity: Enu
    at_ns: int

    def position_at(self, t_ns: int) -> Enu:
        """The position at another instant, by dead reckoning: straight on with the same velocity."""
        return self.position.plus(self.velocity, (t_ns - self.at_ns) / S)

    def offset_from(self, place: Enu, t_ns: int) -> Enu:
        """The vector from a place to the position at another instant."""
        seconds = (t_ns - self.at_ns) / S
        here, v = self.position, self.velocity
        east, north = here.east + v.east * seconds - place.east, here.north + v.north * seconds - place.north
        return _new(Enu, (east, north, here.up + v.up * seconds - place.up))
