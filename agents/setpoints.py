"""Makes the setpoints that a UAV's onboard computer sends to its flight controller.

Each course of an application becomes a setpoint. The last setpoint is repeated again and again, so that the flight
controller knows that the computer is alive: a flight controller that hears none for `mobility.return_after_s` flies
home. A velocity is never repeated; the application that chose it has to choose one again.
"""

from typing import Final

from fanet_mw.application import Course
from fanet_mw.bus.messages import Setpoint, SetpointKind
from fanet_mw.scenario import Scenario
from fanet_mw.units import seconds_to_ns

_REPEATS: Final = 3
"""How often a setpoint is repeated within the time after which a silent computer counts as dead."""


class Setpoints:
    """Makes the setpoints of one UAV, and remembers the last one."""

    def __init__(self, scenario: Scenario) -> None:
        self._repeat_ns = seconds_to_ns(scenario.mobility.return_after_s) // _REPEATS
        """The age at which the last setpoint is repeated; 0: never."""
        self._last: Setpoint | None = None

    def of(self, course: Course, now_ns: int) -> Setpoint:
        """The setpoint for a course."""
        setpoint = Setpoint(now_ns, course.position, course.speed_m_s)
        if course.velocity is not None:
            setpoint = setpoint._replace(kind=SetpointKind.VELOCITY, velocity=course.velocity)
        elif course.land:
            setpoint = setpoint._replace(kind=SetpointKind.LAND)
        elif course.take_off:
            setpoint = setpoint._replace(kind=SetpointKind.TAKEOFF)
        elif course.go_home:
            setpoint = setpoint._replace(kind=SetpointKind.RETURN)
        self._last = setpoint
        return setpoint

    def repeated(self, now_ns: int) -> Setpoint | None:
        """The last setpoint once more, if it is time for that."""
        last = self._last
        if not self._repeat_ns or last is None or last.kind is SetpointKind.VELOCITY:
            return None
        if now_ns - last.t_ns < self._repeat_ns:
            return None
        self._last = last._replace(t_ns=now_ns)
        return self._last
