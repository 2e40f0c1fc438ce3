"""The take-off of a UAV that stands on its pad: straight up to the height of the lanes, clear of those beside it."""

from collections.abc import Mapping
from typing import Final

from agents.mission.flight.reciprocal_avoidance import CLEARANCE_M
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from fanet_mw.application import Course
from fanet_mw.units import Enu, NodeId, S, seconds_to_ns

_CLIMB_M_S: Final = 2.5
_LISTEN_NS: Final = 3 * S
"""How long a UAV listens before it takes off, to learn from hellos who stands beside it."""
_PATIENCE_NS: Final = 40 * S
"""A UAV takes off this long after its start even if another one still stands beside it: that one may be broken."""
_LEAD_M: Final = 15.0
"""Of two UAVs on pads closer than the clearance, the second takes off when the first is this far above it."""
_UP: Final = 0.9
"""A UAV has taken off once it has climbed this share of the height; it climbs the rest on its way."""
_STOPPED_M_S: Final = 0.3
"""A UAV that climbs more slowly than this has not received its setpoint, or has reached the height."""
_TURN_NS: Final = 8 * S
"""How long after one UAV that stands right beside another the other takes off."""
_REPEAT_NS: Final = 2 * S
"""The interval at which the setpoint is sent again while the UAV does not climb."""


def take_off_ns(height_m: float) -> int:
    """The time from the start to the end of a take-off that waits for nobody; a second is for getting up to speed."""
    return _LISTEN_NS + seconds_to_ns(_UP * height_m / _CLIMB_M_S + 1.0)


def turns_ns(pads: Mapping[int, Enu]) -> int:
    """How much longer take-offs last if UAVs stand so near to each other that they take off in turns."""
    turns: dict[int, int] = {}
    for node, pad in sorted(pads.items()):
        before = [turn for other, turn in turns.items() if pads[other].horizontal_to(pad) < CLEARANCE_M]
        turns[node] = 1 + max(before, default=-1)
    return min(_PATIENCE_NS - _LISTEN_NS, max(turns.values(), default=0) * _TURN_NS)


class TakeOff:
    """The take-off of one UAV."""

    def __init__(
        self,
        node: NodeId,
        pad: Enu,
        *,
        own_motion: OwnMotion,
        neighbors: NeighborMotions,
        outbox: Outbox,
        height_m: float,
        beside: set[int] | None = None,
    ) -> None:
        """`pad`: where the UAV stands. `height_m`: of the lanes above ground. `beside`: gets those beside this one."""
        self._beside = set[int]() if beside is None else beside
        self._node, self._pad = node, pad
        self._own_motion, self._neighbors, self._outbox = own_motion, neighbors, outbox
        self._height_m = height_m
        self._began_ns: int | None = None
        self._told_ns: int | None = None
        """The instant at which the take-off was last commanded; None while the UAV waits on its pad."""
        self.lasts = True

    @property
    def stands(self) -> bool:
        """True until it is sent up; False for a UAV that is up already when its program begins, as after a restart."""
        return self._told_ns is None and self._climbed < _UP

    @property
    def left_s(self) -> float:
        """The time that the climb still takes; 0 once the UAV has taken off."""
        climb_m = _UP * self._height_m - (self._own_motion.position.up - self._pad.up)
        return max(0.0, climb_m) / _CLIMB_M_S if self.lasts else 0.0

    def fix(self, now_ns: int) -> None:
        """A position fix: wait, command the take-off, or find that it is over."""
        if self._began_ns is None:
            self._began_ns = now_ns
        climb_m_s = self._own_motion.velocity.up
        if self._told_ns is None:
            if not self.stands:
                self.lasts = False
                return
            if not self._is_clear(now_ns - self._began_ns, now_ns):
                return
        elif self._is_up(climb_m_s):
            self.lasts = False
            return
        elif climb_m_s > _STOPPED_M_S or now_ns - self._told_ns < _REPEAT_NS:
            return
        self._told_ns = now_ns
        above = self._pad._replace(up=self._pad.up + self._height_m)
        self._outbox.course = Course(above, _CLIMB_M_S, take_off=True)

    def _is_clear(self, waited_ns: int, now_ns: int) -> bool:
        """True once no neighbor with a lower id stands or climbs right beside this UAV."""
        heard = self._neighbors.by_node(now_ns=now_ns)
        now = {node for node, motion in heard if self._is_beside(motion.position_at(now_ns))}
        self._beside |= now
        return waited_ns >= _PATIENCE_NS or (waited_ns >= _LISTEN_NS and not any(node < self._node for node in now))

    def _is_beside(self, other: Enu) -> bool:
        off = other.minus(self._pad)
        return off.horizontal() < CLEARANCE_M and off.up < min(_LEAD_M, _UP * self._height_m)

    def _is_up(self, climb_m_s: float) -> bool:
        """True once the UAV has climbed far enough, or no farther than its altitude is measured wrongly."""
        return self._climbed >= _UP or (self._climbed >= 0.5 * _UP and climb_m_s < _STOPPED_M_S)

    @property
    def _climbed(self) -> float:
        """The share of the height."""
        return (self._own_motion.position.up - self._pad.up) / self._height_m
