"""How long a slot's silent end is: as the scenario says, or as long as the clocks and the air ask for."""

from typing import Final

from fanet_mw.airtime import OVERHEAD_BYTES, airtime_ns
from fanet_mw.bounds import guard_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, US

PLANNED_ERROR_NS: Final = 50 * US
"""What a plan before take-off assumes of clocks that are synchronized."""


def slot_guard_ns(scenario: Scenario, *, clock_error_ns: int) -> int:
    """The silent end of a slot; with `auto` for clocks that are at most `clock_error_ns` off at any time.

    `auto` holds one data frame that starts with the slot's last instant; relays that go on after it are not its
    business, as they are not with a given guard.
    """
    given_ms, radio = scenario.clusters.guard_ms, scenario.radio
    if given_ms != "auto":
        return round(given_ms * MS)
    overhang_ns = airtime_ns(scenario.traffic.payload_bytes + OVERHEAD_BYTES, radio, rate_mbps=radio.rate_mbps)
    return guard_ns(
        clock_error_ns=clock_error_ns, drift_ppm=0.0, resync_ns=0, range_m=radio.range_m, overhang_ns=overhang_ns
    )
