"""The return of a UAV whose battery runs low, that hears nobody any more, or whose search is over: it flies home above
all UAVs that search, and lands, at last towards the marker of its own pad. Of UAVs whose pads are beside each other one
lands at a time. A UAV that does not know its position gives up the search as well, and its flight controller holds it.
"""

from collections.abc import Set as AbstractSet
from enum import StrEnum
from typing import Final

from agents.mission.flight.endurance import Endurance
from agents.mission.flight.reciprocal_avoidance import CLEARANCE_M
from agents.mission.flight.search_limits import SearchLimits
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from fanet_mw.application import Course
from fanet_mw.scenario.tables.world import NO_AID_S
from fanet_mw.units import MS, Enu, NodeId, S

HOME_HIGHER_M: Final = 18.0
"""A UAV flies home this far above the lanes; relays and followers fly below it."""
LANDS_WITHIN_M: Final = 1.5
"""The UAV lands once it is within this horizontal distance of its base, and nearly stands."""
_STANDS_M_S: Final = 0.5
"""A UAV that is slower than this nearly stands."""
_HOLD_M: Final = 40.0
"""The distance from its pad at which a UAV waits for its turn."""
_OVER_M: Final = 15.0
"""A UAV this near to its pad has its turn."""
_SUNK_M: Final = 3.0
"""The next UAV comes when the one before has sunk this far below it, and sinks on."""
_SINKS_M_S: Final = 0.7
"""A UAV that is lower and sinks less fast than this is still on its way up, or stands."""
_LOW_M: Final = 25.0
"""A UAV that is lower by this stands at home, or does not come to land."""
_TURN_S: Final = 14.0
"""The time between two landings beside each other."""
_LAND_M_S: Final = 1.5
"""The speed at which a UAV sinks to land."""
_SEEN_NS: Final = 1_500 * MS
"""A UAV goes on towards its pad for this long after it last saw the marker."""
_SEEN_GAIN: Final = 0.3
"""The weight of one sighting of the pad against the earlier ones."""
_TOWARDS_PER_S: Final = 0.5
"""The speed towards the pad is the distance times this, at most `_ASIDE_M_S`."""
_ASIDE_M_S: Final = 1.5
_OFF_M: Final = 0.4
_LOW_OVER_PAD_M: Final = 2.0
"""Lower than this over its pad a UAV waits until it is within `_OFF_M` of it, and then sinks straight down."""
_NO_FIX_NS: Final = 1_500 * MS
"""A UAV does not know where it is after so long without a position, or after `_NO_FIXES` intervals of positions if that
is longer. By then its flight controller holds it, because no velocity is commanded without a position."""
_NO_FIXES: Final = 3


class ReturnReason(StrEnum):
    """Why a UAV flies home; the values are modes of the mission in the trace."""

    BATTERY = "return"
    """Its battery is only enough for the way home."""
    LOST_LINK = "lost_link"
    """It has received nothing from anybody for too long."""
    LOST_POSITION = "lost_position"
    """Its receiver has told no position for too long."""
    DONE = "done"
    RECALLED = "recall"
    """The post on the ground has ordered it."""


class ReturnHome:
    """The return of one UAV: when it leaves its mission, and how it flies home."""

    def __init__(
        self,
        node: NodeId,
        home: Enu,
        own_motion: OwnMotion,
        neighbors: NeighborMotions,
        outbox: Outbox,
        *,
        speed_m_s: float,
        airspeed_m_s: float,
        height_m: float,
        limits: SearchLimits,
        fixes_hz: float,
        beside: AbstractSet[int] = frozenset(),
    ) -> None:
        """`height_m`: of the lanes above ground. `beside`: the UAVs whose pads are beside its own."""
        self._no_fix_ns = max(_NO_FIX_NS, round(_NO_FIXES * S / fixes_hz))
        self._node, self._neighbors, self._beside = node, neighbors, beside
        self._home = home._replace(up=height_m + HOME_HIGHER_M)
        self._own_motion, self._outbox = own_motion, outbox
        self._endurance = Endurance(home, speed_m_s=speed_m_s, reserve=limits.reserve, airspeed_m_s=airspeed_m_s)
        self._limits = limits
        self._heard_ns: int | None = None
        """The instant at which another UAV was last heard; None before the first time: there is no link to lose."""
        self.reason: ReturnReason | None = None
        self._was_blind = False
        """True once the flight controller has not known its position either: it lands, and may obey nothing further."""
        self.lands = False
        self._pad: Enu | None = None
        """The pad, in the UAV's own coordinates, by its marker; None until the camera has seen it on the way home."""
        self._pad_ns = 0
        self._touches_down = False

    def on_battery(self, charge: float, *, now_ns: int) -> bool:
        self._endurance.reserve = self._limits.reserve
        self._endurance.wait_s = _TURN_S * len(self._beside)
        self._endurance.read(charge, now_ns=now_ns, velocity=self._own_motion.velocity)
        if self.reason is ReturnReason.BATTERY or self._endurance.margin(self._own_motion.position) > 0.0:
            return False
        self.reason = ReturnReason.BATTERY
        return True

    def on_wind(self, velocity: Enu) -> None:
        self._endurance.on_wind(velocity)

    def stands_on_pad(self) -> None:
        """Take the position that the receiver states now for the base, because an error that lasts is the same when the
        UAV lands.
        """
        here = self._own_motion.position
        self._home = self._home._replace(east=here.east, north=here.north)

    def on_pad(self, offset: Enu, now_ns: int) -> None:
        """The camera sees the marker of this UAV's pad at this offset from where its receiver says it is."""
        if not self.leaves:
            return
        seen = self._own_motion.position.plus(offset)
        self._pad = seen if self._pad is None else self._pad.plus(seen.minus(self._pad), _SEEN_GAIN)
        self._pad_ns = now_ns
        self._home = self._home._replace(east=self._pad.east, north=self._pad.north)

    def on_heard(self, now_ns: int) -> bool:
        """Another node was heard; returns True if this UAV therefore takes part in the mission again."""
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

    def loses_position(self, now_ns: int) -> bool:
        """True if the UAV must leave now, because it does not know where it is."""
        fixed_ns = self._own_motion.fixed_ns
        if self.leaves or fixed_ns is None or now_ns - fixed_ns <= self._no_fix_ns:
            return False
        self.reason = ReturnReason.LOST_POSITION
        return True

    def on_fix(self, now_ns: int) -> bool:
        """The next position is there; returns True if the UAV therefore takes part in the mission again."""
        if self.reason is not ReturnReason.LOST_POSITION:
            return False
        fixed_ns = self._own_motion.fixed_ns
        self._was_blind |= fixed_ns is not None and now_ns - fixed_ns > NO_AID_S * S
        if self._was_blind:
            return False
        self.reason = None
        return True

    def end(self, reason: ReturnReason = ReturnReason.DONE) -> None:
        """The search is over, or the UAV is recalled: it leaves, unless it flies home already; one that only waits for
        a position flies home once it has one.
        """
        if self.reason in (None, ReturnReason.LOST_POSITION):
            self.reason = reason

    def release(self) -> bool:
        """The recall is taken back; returns True if this UAV therefore takes part in the mission again."""
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
        """Percentage of the battery that may still be spent, for the status; 0 only for a UAV that flies home."""
        if self.leaves:
            return 0
        return max(1, round(100 * self._endurance.margin(self._own_motion.position)))

    def goal(self, now_ns: int) -> Enu:
        """The place above its base to which the UAV flies, or beside it while others land."""
        if not self._waits(now_ns):
            return self._home
        off = self._own_motion.position.minus(self._home)
        away_m = off.horizontal()
        if away_m < 1.0:
            return self._home._replace(east=self._home.east + _HOLD_M)
        out = _HOLD_M / away_m
        return self._home._replace(east=self._home.east + out * off.east, north=self._home.north + out * off.north)

    def _waits(self, now_ns: int) -> bool:
        """True while it is the turn of another UAV whose pad is beside that of this one."""
        here = self._own_motion.position
        has_turn = here.horizontal_to(self._home) <= _OVER_M
        for node in sorted(self._beside):
            motion = self._neighbors.motion(node, now_ns=now_ns)
            other = None if motion is None else motion.position_at(now_ns)
            if motion is None or other is None or other.up < here.up - _LOW_M:
                continue
            if other.up < here.up - _SUNK_M and motion.velocity.up <= -_SINKS_M_S:
                continue
            away_m = other.horizontal_to(self._home)
            is_over, waits = away_m <= _OVER_M + CLEARANCE_M, away_m <= 2 * _HOLD_M
            if (is_over and (node < self._node or not has_turn)) or (waits and node < self._node and not has_turn):
                return True
        return False

    def land_if_there(self, now_ns: int) -> bool:
        """Command the landing at the base in this UAV's turn; again with each call, as a setpoint may get lost."""
        here = self._own_motion.position
        nearly = here.horizontal_to(self._home) <= LANDS_WITHIN_M
        if nearly and self._own_motion.velocity.horizontal() <= _STANDS_M_S and not self._waits(now_ns):
            self.lands = True
        if self.lands:
            self._outbox.course = self._towards_pad(now_ns) or Course(here, _LAND_M_S, land=True)
        return self.lands

    def _towards_pad(self, now_ns: int) -> Course | None:
        """The velocity towards the pad while its marker is seen. None: the UAV sinks straight down, because the marker
        is not seen, or is right below and near.
        """
        if self._pad is None or self._touches_down or now_ns - self._pad_ns > _SEEN_NS:
            return None
        here = self._own_motion.position
        off = self._pad.minus(here)
        is_over = off.horizontal() <= _OFF_M
        self._touches_down = is_over and -off.up <= _LOW_OVER_PAD_M
        if self._touches_down:
            return None
        share = min(_TOWARDS_PER_S, _ASIDE_M_S / max(1e-9, off.horizontal()))
        sinks_m_s = _LAND_M_S if is_over or -off.up > _LOW_OVER_PAD_M else 0.0
        return Course(here, _LAND_M_S, velocity=Enu(share * off.east, share * off.north, -sinks_m_s))
