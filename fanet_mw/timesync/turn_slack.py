"""The slack of turns: how far clocks may be apart so that the turns of different nodes do not overlap."""

from typing import Final

from fanet_mw.scenario import Clock
from fanet_mw.timesync.ftsp import MOST_STATED_NS
from fanet_mw.units import US

_FLIGHT_NS: Final = 20 * US
"""The propagation delay over 6 km; this part of the slack is not available for clock errors."""


def clocks_fit(clock: Clock, *, slack_ns: int, clock_error_ns: int) -> bool:
    """True if turns do not overlap while each clock is within this error; False for an error of 0 of modelled clocks
    (none known yet), and for the largest that a beacon can state, which may be larger.
    """
    if not clock_error_ns:
        return not clock.modelled
    if clock.sync == "beacons" and clock_error_ns >= MOST_STATED_NS:
        return False
    return least_slack_ns(clock_error_ns) <= slack_ns


def has_time(clock: Clock, *, clock_error_ns: int) -> bool:
    """True unless the node waits for beacons to tell it the swarm's time."""
    return clock.sync != "beacons" or not clock.modelled or bool(clock_error_ns)


def least_slack_ns(clock_error_ns: int) -> int:
    return 2 * clock_error_ns + _FLIGHT_NS
