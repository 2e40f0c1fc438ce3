"""Where we are and how we fly, by our own receivers; and where our neighbors are, by their hellos."""

from typing import Final, NamedTuple

from agents.mission.navigation.known_obstacles import KnownObstacles
from fanet_mw.units import Enu, S, seconds_to_ns

_FIX_GAIN: Final = 0.15
"""Weight of a position fix against dead reckoning by its velocity."""
_RANGED_NS: Final = 1 * S
"""A height over the ground is used for so long."""
_HEARD_FOR_NS: Final = seconds_to_ns(6.0)
"""The motion of a neighbor that was not heard for so long is not known any more."""


class Motion(NamedTuple):
    """A position, the velocity there, and when that was."""

    position: Enu
    velocity: Enu
    at_ns: int

    def now(self, now_ns: int) -> Enu:
        """The position at another instant, by dead reckoning."""
        seconds = (now_ns - self.at_ns) / S
        return Enu(
            self.position.east + self.velocity.east * seconds,
            self.position.north + self.velocity.north * seconds,
            self.position.up + self.velocity.up * seconds,
        )


class Navigation:
    """Our own motion: position fixes smoothed by dead reckoning, and the height that a rangefinder and the map tell."""

    def __init__(self, position: Enu, obstacles: KnownObstacles) -> None:
        self.position = position
        self._obstacles = obstacles
        self.velocity = Enu(0.0, 0.0, 0.0)
        self._fix_ns: int | None = None
        self._above_ground: tuple[float, int] | None = None

    def fix(self, position: Enu, velocity: Enu, *, now_ns: int) -> None:
        """The receiver gave a position and a velocity."""
        if self._fix_ns is None:
            self.position = position
        else:
            seconds, k = (now_ns - self._fix_ns) / S, _FIX_GAIN
            here = Motion(self.position, velocity, 0).now(round(seconds * S))
            off = position.minus(here)
            self.position = Enu(here.east + k * off.east, here.north + k * off.north, here.up + k * off.up)
        self._fix_ns, self.velocity = now_ns, velocity

    def altimeter(self, above_ground_m: float | None, *, now_ns: int) -> None:
        """The rangefinder tells how high we are over whatever is below; None: nothing is within its range."""
        if above_ground_m is not None:
            self._above_ground = above_ground_m, now_ns

    def over_ground(self, now_ns: int) -> Enu:
        """Where we are, with the height over the ground in place of that above 0."""
        return self.position._replace(up=self.height_m(now_ns))

    def height_m(self, now_ns: int) -> float:
        """Over the ground, as far as a rangefinder has told lately and no roof is below us; else by the map."""
        ranged = self._above_ground is not None and now_ns - self._above_ground[1] <= _RANGED_NS
        if ranged and self._above_ground is not None and self._obstacles.roof_m(self.position) is None:
            return self._above_ground[0]
        return self.position.up - self._obstacles.ground_m(self.position)


class NeighborMotions:
    """The motion of each neighbor, as its latest hello told it."""

    def __init__(self) -> None:
        self._motions: dict[int, Motion] = {}

    def on_hello(self, node: int, motion: Motion) -> None:
        """A hello said how its sender flies."""
        self._motions[node] = motion

    def motion(self, node: int, *, now_ns: int) -> Motion | None:
        """How a neighbor flies; None when it was not heard lately."""
        motion = self._motions.get(node)
        return None if motion is None or now_ns - motion.at_ns > _HEARD_FOR_NS else motion

    def all(self, *, now_ns: int) -> list[Motion]:
        """The motions of those that were heard lately, in order of id."""
        return [motion for _, motion in sorted(self._motions.items()) if now_ns - motion.at_ns <= _HEARD_FOR_NS]
