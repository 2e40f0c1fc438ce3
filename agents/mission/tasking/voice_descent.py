"""Goes down to listen: microphones that make a call out only from close by are brought near the ground.

    near the estimated place, nobody seen    down by halves, to the height from which the microphones reach the ground
    down there                               a narrow spiral from the estimated place outward, to hear all around it
    a call is heard                          a small circle around the caller, until the survivor is confirmed
    confirmed, or given up                   up again, as high as the UAV's place in the formation

Below half of the height of the search there is one UAV at a time near a survivor; others wait above it.
"""

import math
from typing import Final

from agents.mission.finding.phone_localization import Estimate
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw.scenario import Scenario
from fanet_mw.units import GOLDEN_ANGLE, Enu, NodeId, S

_HEIGHT: Final = 1 / math.sqrt(2)
"""The listening height as a share of the range of the microphones, which then reach as far to the side as down."""
LEAST_M: Final = 8.0
"""A UAV does not go down below this height above ground."""
_NEAR_M: Final = 80.0
"""A UAV goes down within this horizontal distance of the estimated place."""
_LOOK_NS: Final = 10 * S
"""How long a UAV with a camera looks around from above before it goes down."""
_STANDS_M: Final = LEAST_M / 2
"""A UAV that is less than this above the ground stands there, on its pad or because it has landed, and does not
listen. The ground is that below the UAV that judges."""
_ALONE_M: Final = 70.0
"""Other UAVs within this horizontal distance of the estimated place take part in who goes down first."""
_STEP_DONE_M: Final = 4.0
"""A UAV that is within this distance of the height of its step begins the next step."""
_LEVEL_M: Final = 3.0
"""Of two UAVs whose heights differ by less than this, the one with the lower id goes down first."""
_PITCH: Final = 1.6
"""The distance of two turns of the spiral, as a multiple of the distance to the side at which a call is made out."""
_TURN_PER_S: Final = 0.35
"""The angular speed on the spiral and the circle [rad/s]."""
_CALLER: Final = 0.6
"""The radius of the circle around a caller, as a share of the distance to the side at which a call is made out."""
_MOST_M: Final = 60.0
"""The spiral begins anew at the estimated place when it is this wide."""
_SINK_M_S: Final = 2.0


def hearing_m(scenario: Scenario) -> float:
    """The range of the microphones of a hovering UAV, by spherical spreading of the sound alone; 0 without any."""
    sensors = scenario.sensors
    if not sensors.voice_hz:
        return 0.0
    margin_db = sensors.voice_level_db - sensors.voice_rotor_db + sensors.voice_gain_db - sensors.voice_snr_db
    return 10 ** (margin_db / 20)


def listening_height_m(scenario: Scenario) -> float | None:
    """The height above ground to listen at; None if not needed, or the ground is out of reach at the least height."""
    range_m = hearing_m(scenario)
    height_m = max(LEAST_M, _HEIGHT * range_m)
    return height_m if height_m < min(range_m, scenario.nodes.altitude_m) else None


def descent_ns(scenario: Scenario) -> int:
    """The time that a UAV of this scenario needs to look around and to go down; 0 if it does not go down."""
    height_m = listening_height_m(scenario)
    if height_m is None:
        return 0
    looks_ns = _LOOK_NS if scenario.sensors.camera_hz else 0
    return looks_ns + round((scenario.nodes.altitude_m - height_m) / _SINK_M_S * S)


class VoiceDescent:
    """The descent of one UAV to the survivor whom it examines, and its way around the place down there."""

    def __init__(
        self, scenario: Scenario, node: NodeId, own_motion: OwnMotion, neighbors: NeighborMotions, *, speed_m_s: float
    ) -> None:
        self._node = node
        self._own_motion, self._neighbors = own_motion, neighbors
        self._speed_m_s = speed_m_s
        self._height_m = listening_height_m(scenario)
        range_m = hearing_m(scenario)
        self._aside_m = 0.0 if self._height_m is None else math.sqrt(range_m * range_m - self._height_m**2)
        """The horizontal distance at which a call is made out from the listening height."""
        self._half_m = scenario.nodes.altitude_m / 2
        self._look_ns = _LOOK_NS if scenario.sensors.camera_hz else 0
        self._survivor: int | None = None
        self._near_ns: int | None = None
        self._step_m = math.inf
        self._low_ns: int | None = None

    def goal(self, survivor: int, place: Estimate, goal: Enu, *, seen: bool, misses_m: float, now_ns: int) -> Enu:
        """The place to fly to, above ground, instead of `goal`, which looks from above; `seen`: a person seems to own
        the phone. `misses_m`: how far from the place the formation keeps this UAV, which goes down only if it could
        hear a call there.
        """
        if self._height_m is None:
            return goal
        if survivor != self._survivor:
            self._survivor, self._near_ns, self._low_ns, self._step_m = survivor, None, None, goal.up
        kept_off = misses_m > self._aside_m  # it would hear no call from the estimated place
        if kept_off or place.distance_m(self._own_motion.position) > _NEAR_M:
            self._near_ns = self._low_ns = None
            self._step_m = goal.up
            return goal
        if self._near_ns is None:
            self._near_ns = now_ns
        if seen and self._low_ns is None:  # from above: it is seen best from there
            self._step_m = goal.up
        elif now_ns - self._near_ns >= self._look_ns:
            self._step_down(place, goal.up, self._height_m, now_ns)
        if self._low_ns is None:
            return goal._replace(up=self._step_m)
        east_m, north_m = self._around(seen, (now_ns - self._low_ns) / S)
        return Enu(place.east_m + east_m, place.north_m + north_m, self._step_m)

    def _step_down(self, place: Estimate, up_m: float, height_m: float, now_ns: int) -> None:
        self._step_m = min(self._step_m, up_m)
        if self._own_motion.height_m(now_ns) > self._step_m + _STEP_DONE_M:
            return
        if self._step_m <= height_m:
            self._low_ns = now_ns if self._low_ns is None else self._low_ns
            return
        below_m = max(height_m, self._step_m / 2)
        if below_m >= self._half_m or self._is_first(place, now_ns):
            self._step_m = below_m

    def _is_first(self, place: Estimate, now_ns: int) -> bool:
        """True if no other UAV in flight near the place is lower, or as low and has a lower id."""
        here = self._own_motion.position
        ground_m = here.up - self._own_motion.height_m(now_ns)
        for node, motion in self._neighbors.by_node(now_ns=now_ns):
            other = motion.position_at(now_ns)
            if place.distance_m(other) > _ALONE_M or other.up < ground_m + _STANDS_M:
                continue
            higher_m = other.up - here.up
            if higher_m <= -_LEVEL_M or (higher_m < _LEVEL_M and node < self._node):
                return False
        return True

    def _around(self, seen: bool, listened_s: float) -> tuple[float, float]:
        """East and north of the point on the spiral or the circle, from its middle."""
        growth_m_s = _PITCH * self._aside_m * _TURN_PER_S / math.tau
        radius_m = _CALLER * self._aside_m if seen else (growth_m_s * listened_s) % _MOST_M
        angle = self._node * GOLDEN_ANGLE + turned_rad(
            _TURN_PER_S * listened_s, radius_m, growth_m_s, widest_m=self._speed_m_s / _TURN_PER_S
        )
        return radius_m * math.cos(angle), radius_m * math.sin(angle)


def turned_rad(turned: float, radius_m: float, growth_m_s: float, *, widest_m: float) -> float:
    """A spiral's angle at a radius, at full angular speed `turned`; beyond `widest_m` no faster than can be flown."""
    if radius_m <= widest_m:
        return turned
    beyond = _TURN_PER_S / growth_m_s * (radius_m - widest_m)
    return turned - beyond + _TURN_PER_S * widest_m / growth_m_s * math.log(radius_m / widest_m)
