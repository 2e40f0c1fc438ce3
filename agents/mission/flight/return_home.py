"""The return of a UAV whose battery runs low, that hears nobody any more, or whose search is over: it flies home above
all UAVs that search, then lands straight down. Its task and its place in the formation are handed on before
(`agents/mission/searcher.py`, `agents/mission/search_formation/formation_planner.py`).
"""

from enum import StrEnum
from typing import Final

from agents.mission.flight.endurance import Endurance
from agents.mission.flight.search_limits import SearchLimits
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from fanet_mw.application import Course
from fanet_mw.units import Enu

_HIGHER_M: Final = 18.0
"""A UAV flies home this far above the lanes; relays and followers fly below it."""
_HOME_M: Final = 4.0
"""The UAV lands once it is within this horizontal distance of its base."""
_LAND_M_S: Final = 1.5
"""The speed of the landing."""


class ReturnReason(StrEnum):
    """Why a UAV flies home; the values are modes of the mission in the trace."""

    BATTERY = "return"
    """Its battery is only enough for the way home."""
    LOST_LINK = "lost_link"
    """It has received nothing from anybody for too long."""
    DONE = "done"
    """The search is over."""
    RECALLED = "recall"
    """The post on the ground has ordered it."""


class ReturnHome:
    """The return of one UAV: when it leaves its mission, and how it flies home."""

    def __init__(
        self,
        home: Enu,
        own_motion: OwnMotion,
        outbox: Outbox,
        *,
        speed_m_s: float,
        height_m: float,
        limits: SearchLimits,
    ) -> None:
        """`height_m`: the height of the lanes above ground. `limits`: with which charge it is to land, and how long it
        may hear nobody.
        """
        self._home = home._replace(up=height_m + _HIGHER_M)
        self._own_motion, self._outbox = own_motion, outbox
        self._endurance = Endurance(home, speed_m_s=speed_m_s, reserve=limits.reserve)
        self._limits = limits
        self._heard_ns: int | None = None
        """The instant at which another UAV was last heard; None before the first time: there is no link to lose."""
        self.reason: ReturnReason | None = None
        """Why it flies home; None while it takes part in the mission."""
        self.lands = False
        """True from the moment at which it has reached its base and lands."""

    def on_battery(self, charge: float, *, now_ns: int) -> bool:
        """A reading of the battery; returns True if the UAV must leave now."""
        self._endurance.reserve = self._limits.reserve
        self._endurance.read(charge, now_ns=now_ns)
        if self.reason is ReturnReason.BATTERY or self._endurance.margin(self._own_motion.position) > 0.0:
            return False
        self.reason = ReturnReason.BATTERY
        return True

    def on_heard(self, now_ns: int) -> bool:
        """Another UAV was heard; returns True if this one therefore takes part in the mission again."""
        self._heard_ns = now_ns
        if self.reason is not ReturnReason.LOST_LINK or self.lands:
            return False
        self.reason = None
        return True

    def loses_link(self, now_ns: int) -> bool:
        """True if the UAV must leave now, because it has not heard anybody for too long."""
        heard_ns, most_ns = self._heard_ns, self._limits.lost_link_ns
        if not most_ns or heard_ns is None or self.leaves or now_ns - heard_ns < most_ns:
            return False
        self.reason = ReturnReason.LOST_LINK
        return True

    def end(self, reason: ReturnReason = ReturnReason.DONE) -> None:
        """The search is over, or the UAV is recalled: it leaves now."""
        self.reason = self.reason or reason

    def release(self) -> bool:
        """End a recall; returns True if the UAV therefore takes part in the mission again."""
        if self.reason is not ReturnReason.RECALLED or self.lands:
            return False
        self.reason = None
        return True

    @property
    def leaves(self) -> bool:
        """True while the UAV flies home, and once it has landed there."""
        return self.reason is not None

    @property
    def percent(self) -> int:
        """The percentage of the battery that the UAV may still spend, for its status; 0 only for a
        UAV that flies home.
        """
        if self.leaves:
            return 0
        return max(1, round(100 * self._endurance.margin(self._own_motion.position)))

    @property
    def goal(self) -> Enu:
        """The place above its base to which the UAV flies."""
        return self._home

    def land_if_there(self) -> bool:
        """Command the landing if the UAV has reached its goal; returns True once it lands.

        Each call commands it again, because a setpoint may get lost on its way to the flight controller.
        """
        here = self._own_motion.position
        if here.minus(self._home).horizontal() <= _HOME_M:
            self.lands = True
        if self.lands:
            self._outbox.course = Course(here, _LAND_M_S, land=True)
        return self.lands
