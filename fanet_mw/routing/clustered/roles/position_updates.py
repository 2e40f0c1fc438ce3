"""Position updates to the leader: dead reckoning, as in IEEE 1278.1 (distributed interactive simulation).

The leader extrapolates the last position with the last velocity that it was told. A node sends an update when it is
farther than a share of the radio range from where the leader must believe it to be, or when it has flooded nothing for
so long that the leader might take it for dead. So a swarm that flies straight, or hovers, costs nothing.
"""

from typing import Final

from fanet_mw.motion import Motion
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, S, seconds_to_ns

_SHARE: Final = 0.1
"""The share of the radio range by which dead reckoning may err."""
_LEAST_NS: Final = 5 * S
"""The least time between two updates, because each is a flood."""
_QUIET_NS: Final = 20 * S
UPDATE_NS: Final = 100 * MS
"""Updates are spread over this much per node: ten floods a second when all must be made at once."""
_HELLO_VARIES: Final = 1.1
"""An update is due with a hello, and hellos vary by a tenth of their interval."""
_A_LITTLE_NS: Final = 2 * S


def lost_ns(scenario: Scenario) -> int:
    """The time without a sign of life after which the leader forgets a node: two updates and a little.

    An update waits for 20 s without a flood, the next hello, its part of the spread, and a turn of the node.
    """
    routing, clusters = scenario.routing, scenario.clusters
    hello_ns = round(_HELLO_VARIES * seconds_to_ns(routing.hello_interval_s))
    update_ns = _QUIET_NS + hello_ns + UPDATE_NS * (1 + scenario.nodes.count) + clusters.period_ns
    return 2 * update_ns + _A_LITTLE_NS


class PositionUpdates:
    """What the leader believes of one node, as that node knows, and when that has to be corrected."""

    def __init__(self, *, range_m: float) -> None:
        self._off_m = _SHARE * range_m
        self._told: Motion | None = None
        self._flooded_ns = 0

    def on_update(self, motion: Motion) -> None:
        """Note that a join told this motion."""
        self._told = motion
        self._flooded_ns = motion.at_ns

    def on_flooding(self, now_ns: int) -> None:
        """Note that a packet of this node goes to all nodes, which is a sign of life."""
        self._flooded_ns = now_ns

    def may_update(self, now_ns: int) -> bool:
        """True if the last join is long enough ago for another."""
        return self._told is None or now_ns - self._told.at_ns >= _LEAST_NS

    def outdated(self, position: Enu, *, now_ns: int) -> bool:
        """True if it is time for another update."""
        if self._told is None or not self.may_update(now_ns):
            return False
        off_m = position.minus(self._told.position_at(now_ns)).norm()
        return off_m > self._off_m or now_ns - self._flooded_ns > _QUIET_NS
