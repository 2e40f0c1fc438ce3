"""How an uploaded mission is flown: which item is current, and when the next one's turn comes."""

import math
from collections.abc import Callable, Sequence
from typing import Final

from agents.ground_control.plans import USUAL_SPEED, Step
from fanet_mw.mavlink import common
from fanet_mw.units import Enu, S

TAKEOFF: Final = common.MAV_CMD_NAV_TAKEOFF
LAND: Final = common.MAV_CMD_NAV_LAND
_RETURN: Final = common.MAV_CMD_NAV_RETURN_TO_LAUNCH
_SPEED: Final = common.MAV_CMD_DO_CHANGE_SPEED
_JUMP: Final = common.MAV_CMD_DO_JUMP
_FOREVER: Final = common.MAV_CMD_NAV_LOITER_UNLIM
_DELAYS: Final = (common.MAV_CMD_NAV_DELAY, common.MAV_CMD_CONDITION_DELAY)
_HEIGHT_M: Final = 3.0
"""How exactly the height of a waypoint or take-off is met, however near counts as reached."""
_MOST_AT_ONCE: Final = 1000
"""Items without a place that are carried out in one step; jumps could go round for ever."""


class MissionFlight:
    """One mission, and how far it has been flown."""

    def __init__(self) -> None:
        self.steps: Sequence[Step] = ()
        self.at = 0
        """The index of the current item; their number when all were flown."""
        self.idle = True
        self.returns = False
        """True if the current item asks for a return."""
        self.speed_m_s: float | None = None
        """A speed that an item has asked for, until the pilot takes it."""
        self.on_reached: Callable[[int], None] = lambda _: None
        self._since_ns: int | None = None
        self._jumps: dict[int, int] = {}

    def load(self, steps: Sequence[Step]) -> None:
        """Take another mission, from its beginning; it is not flown before it is started."""
        self.steps = tuple(steps)
        self.idle = True
        self.go_to(0)

    def go_to(self, at: int) -> None:
        self.at, self._since_ns, self.returns = at, None, False
        if not at:
            self._jumps.clear()

    def resume(self) -> None:
        """Go on where the mission was left, or from the beginning when it is over."""
        if self.at >= len(self.steps):
            self.go_to(0)
        self.idle, self.returns, self._since_ns = False, False, None

    def pause(self) -> None:
        self.idle = True

    def landed(self) -> None:
        """The UAV has landed; if a mission was flown, its current item was the landing."""
        if not self.idle:
            self._reached()
        self.idle = True

    def fly(self, here: Enu, now_ns: int, *, reached_m: float, on_ground: bool) -> Step | None:
        """The item to fly now; None when the mission is over, or asks for a return (`returns`)."""
        for _ in range(_MOST_AT_ONCE):
            if self.at >= len(self.steps):
                return None
            step = self.steps[self.at]
            if step.command == _RETURN:
                self._reached()
                self.returns = True
                return None
            if not self._is_done(step, here, now_ns, reached_m=reached_m, on_ground=on_ground):
                return step
            self._reached()
        return None

    def _reached(self) -> None:
        self.on_reached(self.at)
        step = self.steps[self.at]
        if step.command == _JUMP:
            target, times = round(step.params[0]), step.params[1]
            done = self._jumps.get(self.at, 0)
            if 0 <= target < len(self.steps) and (times < 0 or done < times):
                self._jumps[self.at] = done + 1
                self.at, self._since_ns = target, None
                return
        self.at += 1
        self._since_ns = None

    def _is_done(self, step: Step, here: Enu, now_ns: int, *, reached_m: float, on_ground: bool) -> bool:
        if step.command == _SPEED:
            if step.params[1] > 0 or step.params[1] == USUAL_SPEED:
                self.speed_m_s = step.params[1]
            return True
        if step.command == _JUMP:
            return True
        if step.command == LAND:
            return False  # the landing ends the mission (`Pilot`)
        if step.place is not None and (on_ground or not _is_near(step.place, here, step.command, reached_m)):
            return False
        if self._since_ns is None:
            self._since_ns = now_ns
        if step.command == _FOREVER:
            return False
        waits = step.command in (*_DELAYS, common.MAV_CMD_NAV_WAYPOINT, common.MAV_CMD_NAV_LOITER_TIME)
        wait_s = step.params[0] if waits and math.isfinite(step.params[0]) else 0.0
        return now_ns - self._since_ns >= max(0.0, wait_s) * S


def _is_near(place: Enu, here: Enu, command: int, reached_m: float) -> bool:
    high = abs(here.up - place.up) <= _HEIGHT_M
    if command == TAKEOFF or math.isnan(place.east):
        return high
    return high and math.hypot(here.east - place.east, here.north - place.north) <= reached_m
