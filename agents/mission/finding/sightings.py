"""The people whom a UAV's camera shows and whose voices its microphones make out, as places on the ground."""

import math
from collections.abc import Callable, Sequence
from typing import Final

from agents.mission.finding.camera_view import CameraView
from agents.mission.finding.confirmation import CLOSE_M
from agents.mission.finding.height_error import HeightError
from agents.mission.finding.identities import Identities, Sighting
from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.finding.person_track import PersonTrack
from agents.mission.finding.phone_localization import Estimate
from agents.mission.finding.refutation import Refutation
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from fanet_mw.bus.messages import Call, Person
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Sighted
from fanet_mw.units import Enu, NodeId, S

_FARTHEST_M: Final = 2 * CLOSE_M
"""Calls from a greater slant range are ignored."""
_ANGLE_RAD: Final = 0.03
"""The standard deviation of the direction in which a camera shows a person, errors of the UAV's attitude included."""
_LEAST_DEPRESSION_RAD: Final = 0.05
"""A direction that is less steep than this is not taken to hit the ground."""
_RAY_STEP_M: Final = 10.0
_RAY_STEPS: Final = 100
"""Directions are followed in such steps until they are below the ground, so far at most."""
_HALVINGS: Final = 8
"""The last step is halved so often, to 4 cm."""
_CALL_EVIDENCE: Final = 9.0
"""The evidence of a call: an array hardly takes anything else for one."""
_SETTLED_NS: Final = S // 5
"""An image that has not come after this time has shown nobody."""


class Sightings:
    """Turns what camera and microphones detect into positions of people, which `Identities` matches with phones."""

    def __init__(
        self, scenario: Scenario, node: NodeId, survivors: KnownSurvivors, own_motion: OwnMotion, outbox: Outbox
    ) -> None:
        self._node = node
        sensors, bias_m = scenario.sensors, scenario.sensors.gps_bias_m
        up_m = 0.0 if sensors.altimeter_hz else sensors.gps_vertical * math.hypot(sensors.gps_common_m, bias_m)
        self._identities = Identities(
            survivors, bias_m=bias_m, height_error=HeightError(up_m, tau_s=sensors.gps_common_time_s)
        )
        self.steady_m2 = 1.0 + bias_m * bias_m
        """The variance of the part of the error of positions that lasts, along each axis."""
        self._refutation = Refutation(survivors, self._identities)
        self._own_motion, self._outbox = own_motion, outbox
        self._voice_rad = math.radians(scenario.sensors.voice_sigma_deg)
        self._view = CameraView(scenario)
        self._imaged_ns: int | None = None

    def camera(self, people: Sequence[Person], *, now_ns: int) -> None:
        self._empty_images(now_ns)
        here = self._own_motion.over_ground(now_ns)
        self._imaged_ns = now_ns
        evidence = self._view.sighting_evidence(here.up)
        directions = [(person.bearing_rad, person.elevation_rad, _ANGLE_RAD) for person in people]
        shown = self._sighted("camera", directions, math.inf, evidence=evidence, now_ns=now_ns)
        self._identities.on_images(
            1, lambda place: self._shows(place, here), evidence=self._view.empty_evidence(here.up), but=shown
        )

    def voice(self, calls: Sequence[Call], *, now_ns: int) -> None:
        directions = [
            (call.bearing_rad, call.elevation_rad, max(_ANGLE_RAD, self._voice_rad * math.pow(10.0, -call.snr_db / 20)))
            for call in calls
        ]
        self._sighted("voice", directions, _FARTHEST_M, evidence=_CALL_EVIDENCE, now_ns=now_ns)

    def review(self, now_ns: int) -> list[int]:
        """The survivors who may be confirmed now: their phones surely belong to people who have been seen."""
        self._empty_images(now_ns - _SETTLED_NS)
        return self._identities.review(now_ns)

    def take_among(self) -> dict[int, Estimate]:
        """The survivors who are each one of several people, none of them for certain, and where those people are."""
        return self._identities.take_among()

    def unreported(self, now_ns: int) -> list[Estimate]:
        """The places of the people who are certainly there and of whom there is no find."""
        return self._identities.unreported(now_ns)

    def refuted(self) -> list[int]:
        """The survivors whose confirmation is refuted by powers and sightings that came after it."""
        return self._refutation.review()

    def _empty_images(self, now_ns: int) -> None:
        """Take in the images up to now that have shown nobody, of which nothing was told."""
        if not self._view.hz or self._imaged_ns is None:
            return
        period_ns = S / self._view.hz
        count = max(0, math.ceil((now_ns - self._imaged_ns) / period_ns - 0.5) - 1)
        if count:
            self._imaged_ns += round(count * period_ns)
            here = self._own_motion.over_ground(now_ns)
            evidence = self._view.empty_evidence(here.up)
            self._identities.on_images(count, lambda place: self._shows(place, here), evidence=evidence)

    def _shows(self, place: Enu, here: Enu) -> bool:
        """True if a place is in the image taken at `here`, whose height is the one above ground."""
        rise_m = self._own_motion.rise_m
        return self._view.shows(place if rise_m is None else place._replace(up=rise_m(place.east, place.north)), here)

    def _sighted(
        self,
        sensor: str,
        directions: Sequence[tuple[float, float, float]],
        farthest_m: float,
        *,
        evidence: float,
        now_ns: int,
    ) -> list[PersonTrack]:
        """People at these bearings and elevations, each with its deviation [rad], unless too far away on the ground."""
        here, sightings = self._own_motion.over_ground(now_ns), []
        for bearing_rad, elevation_rad, sigma_rad in directions:
            looked = ground_place(
                here, bearing_rad=bearing_rad, elevation_rad=elevation_rad, rise_m=self._own_motion.rise_m
            )
            if looked is None or looked[2] > farthest_m:
                continue
            sigma_m = max(1.0, sigma_rad * looked[2] * looked[2] / max(1.0, here.up))
            close = sensor == "camera" or looked[2] <= CLOSE_M
            sightings.append(Sighting(Enu(looked[0], looked[1], 0.0), sigma_m, close))
        shown = self._identities.on_reading(sightings, here=here, evidence=evidence, now_ns=now_ns)
        for (at, _, _), person in zip(sightings, shown, strict=True):
            self._outbox.records.append(
                Sighted(now_ns, self._node, sensor, person.survivor or 0, round(at.east, 2), round(at.north, 2))
            )
        return shown


def ground_place(
    at: Enu, *, bearing_rad: float, elevation_rad: float, rise_m: Callable[[float, float], float] | None = None
) -> tuple[float, float, float] | None:
    """East and north of the place where a direction from `at` first meets the ground, and the slant range; None above
    the horizon, or so little below it (`_LEAST_DEPRESSION_RAD`) that a small error would move the place by far. `at.up`
    is above ground; `rise_m`: by how much the ground is higher at a place than below `at`.
    """
    if elevation_rad >= -_LEAST_DEPRESSION_RAD:
        return None
    east, north, falls = math.sin(bearing_rad), math.cos(bearing_rad), math.tan(-elevation_rad)
    along_m, down_m = at.up / falls, at.up
    if rise_m is not None:

        def ground_below_m(along_m: float) -> float:
            return at.up - rise_m(at.east + along_m * east, at.north + along_m * north)

        far_m = next((m for k in range(1, _RAY_STEPS) if (m := k * _RAY_STEP_M) * falls >= ground_below_m(m)), None)
        if far_m is None:
            return None
        along_m = far_m - _RAY_STEP_M
        for halving in range(1, _HALVINGS + 1):
            further_m = along_m + _RAY_STEP_M / 2**halving
            if further_m * falls < ground_below_m(further_m):
                along_m = further_m
        down_m = ground_below_m(along_m)
    return at.east + along_m * east, at.north + along_m * north, math.hypot(along_m, down_m)
