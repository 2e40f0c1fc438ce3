"""The people whom a UAV's camera shows and whose voices its microphones make out, as places on the ground."""

import math
from collections.abc import Sequence
from typing import Final

from agents.mission.finding.confirmation import CLOSE_M
from agents.mission.finding.contradictions import Contradictions
from agents.mission.finding.identities import Identities
from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Sighted
from fanet_mw.units import Enu, NodeId

_FARTHEST_M: Final = 2 * CLOSE_M
"""Sightings from a greater slant range are ignored."""
_ANGLE_RAD: Final = 0.03
"""The standard deviation of the direction in which a camera shows a person, errors of the UAV's attitude included."""
_LEAST_DEPRESSION_RAD: Final = 0.05
"""A direction that is less steep than this is not taken to hit the ground."""


class Sightings:
    """Turns what the camera and the microphones of one UAV detect into positions of people, which `Identities` matches
    with phones.
    """

    def __init__(
        self, scenario: Scenario, node: NodeId, survivors: KnownSurvivors, own_motion: OwnMotion, outbox: Outbox
    ) -> None:
        self._node = node
        self._identities = Identities(survivors)
        self._contradictions = Contradictions(survivors, self._identities)
        self._own_motion, self._outbox = own_motion, outbox
        self._voice_rad = math.radians(scenario.sensors.voice_sigma_deg)

    def camera(self, people: Sequence[tuple[float, float]], *, now_ns: int) -> None:
        """The camera shows people at these bearings and elevations [rad]."""
        for direction in people:
            self._sighted("camera", direction, sigma_rad=_ANGLE_RAD, now_ns=now_ns)

    def voice(self, calls: Sequence[tuple[float, float, float]], *, now_ns: int) -> None:
        """The microphones detect voices at these bearings and elevations [rad], with these signal-to-noise ratios."""
        for bearing_rad, elevation_rad, snr_db in calls:
            sigma_rad = max(_ANGLE_RAD, self._voice_rad * math.pow(10.0, -snr_db / 20))
            self._sighted("voice", (bearing_rad, elevation_rad), sigma_rad=sigma_rad, now_ns=now_ns)

    def review(self, now_ns: int) -> list[int]:
        """The survivors who may be confirmed now, because each of their phones surely belongs to a person who has been
        seen.
        """
        return self._identities.review(now_ns)

    def contradicted(self) -> list[int]:
        """The survivors whose confirmation is contradicted by powers and sightings that came after it."""
        return self._contradictions.review()

    def _sighted(self, sensor: str, direction: tuple[float, float], *, sigma_rad: float, now_ns: int) -> None:
        """Take in that a sensor detects a person in a direction, if the place on the ground is not too far away."""
        here = self._own_motion.over_ground(now_ns)
        looked = ground_place(here, bearing_rad=direction[0], elevation_rad=direction[1])
        if looked is None or looked[2] > _FARTHEST_M:
            return
        sigma_m = max(1.0, sigma_rad * looked[2] * looked[2] / max(1.0, here.up))
        at = Enu(looked[0], looked[1], 0.0)
        survivor = self._identities.on_sighting(
            at, sigma_m=sigma_m, close=looked[2] <= CLOSE_M, now_ns=now_ns, sensor=sensor
        )
        self._outbox.records.append(
            Sighted(now_ns, self._node, sensor, survivor or 0, round(at.east, 2), round(at.north, 2))
        )


def ground_place(at: Enu, *, bearing_rad: float, elevation_rad: float) -> tuple[float, float, float] | None:
    """East and north of the place where a direction from `at` meets the ground, and the slant range to that place.

    `at.up` is the height above the ground, which is taken to be level. None for directions above the horizon, and for
    those so little below it (`_LEAST_DEPRESSION_RAD`) that a small error of the direction would move the place by far.
    """
    if elevation_rad >= -_LEAST_DEPRESSION_RAD:
        return None
    along_m = at.up / math.tan(-elevation_rad)
    return (
        at.east + along_m * math.sin(bearing_rad),
        at.north + along_m * math.cos(bearing_rad),
        math.hypot(along_m, at.up),
    )
