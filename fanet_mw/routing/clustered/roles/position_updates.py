"""Decides when a node sends its position to the leader: dead reckoning, as in IEEE 1278.1.

The leader extrapolates from the last position and velocity that it was told. A node sends an update when it is farther
than a share of the radio range from there, or has flooded nothing for so long that it might be taken for failed.
"""

from typing import Final

from fanet_mw.motion import Motion
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, S, seconds_to_ns

STRAYED: Final = 0.1
"""The share of the radio range by which the extrapolated position may be wrong."""
UNLIKE: Final = 0.02
"""The share of the radio range by which the leader may be wrong about the place of a node in a rigid formation."""
_LEAST_NS: Final = 5 * S
"""The shortest time between two updates, because each is a flood."""
_QUIET_NS: Final = 20 * S
"""The time without a flood of its own after which a node sends an update as a sign of life."""
UPDATE_NS: Final = 100 * MS
"""Updates are spread over so much per node: at most ten floods a second when all must update."""
_HELLO_VARIES: Final = 1.1
"""Updates are sent with hellos, whose interval varies by a tenth."""
_A_LITTLE_NS: Final = 2 * S
"""The margin of the time after which the leader forgets a node."""


def lost_ns(scenario: Scenario) -> int:
    """The silence after which the leader forgets a node: two updates, each due after 20 s, and a margin."""
    return 2 * (_QUIET_NS + _update_ns(scenario)) + _A_LITTLE_NS


def settled_ns(scenario: Scenario) -> int:
    """The time after which the leader has been told of a turn that all made together: each tells as it has strayed,
    once per `_LEAST_NS`. Until then the leader believes the swarm to fall apart.
    """
    speed_m_s = max(scenario.mobility.speed_m_s, 1.0)
    straying_ns = round(STRAYED * (scenario.clusters.link_m or scenario.radio.range_m) / speed_m_s * S)
    return straying_ns + _LEAST_NS + _update_ns(scenario)


def _update_ns(scenario: Scenario) -> int:
    """The time that an update which is due waits for the next hello, its share of the spread, and a turn."""
    hello_ns = round(_HELLO_VARIES * seconds_to_ns(scenario.routing.hello_interval_s))
    return hello_ns + UPDATE_NS * (1 + scenario.node_count) + scenario.clusters.period_ns


class PositionUpdates:
    """The leader's belief about the motion of one node, as that node knows it."""

    def __init__(self, *, range_m: float) -> None:
        self._off_m = STRAYED * range_m
        self._told: Motion | None = None
        """The motion that the node's last join has stated; None before the first one."""
        self._flooded_ns = 0
        """The instant of the node's latest flood."""

    def on_update(self, motion: Motion) -> None:
        self._told = motion
        self._flooded_ns = motion.at_ns

    def on_flooding(self, now_ns: int) -> None:
        self._flooded_ns = now_ns

    def may_update(self, now_ns: int) -> bool:
        """True if the last join was long enough ago for another one."""
        return self._told is None or now_ns - self._told.at_ns >= _LEAST_NS

    def outdated(self, position: Enu, *, now_ns: int) -> bool:
        if self._told is None or not self.may_update(now_ns):
            return False
        off_m = position.minus(self._told.position_at(now_ns)).norm()
        return off_m > self._off_m or now_ns - self._flooded_ns > _QUIET_NS
