"""The guard time of a slot: set by the scenario, or computed from clock error, propagation and frame length.

No frame starts in it (`Superframe` in `fanet_mw/routing/clustered/tdma/slot_timing.py`). Between the turns of a
timetable the guard is called slack (`fanet_mw/timesync/turn_slack.py`).
"""

from math import ceil
from typing import Final

from fanet_mw.airtime import OVERHEAD_BYTES, airtime_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import LIGHT_M_PER_S, MS, US, S

PLANNED_ERROR_NS: Final = 50 * US
"""The clock error that a plan before take-off assumes of synchronized clocks."""


def slot_guard_ns(scenario: Scenario, *, clock_error_ns: int) -> int:
    """The guard time of a slot; `auto` covers two opposite clock errors of `clock_error_ns`, the propagation over
    `radio.range_m`, and one data frame that starts just before the guard, but no relays that follow it.
    """
    given_ms, radio = scenario.clusters.guard_ms, scenario.radio
    if given_ms != "auto":
        return round(given_ms * MS)
    overhang_ns = airtime_ns(scenario.traffic.payload_bytes + OVERHEAD_BYTES, radio, rate_mbps=radio.rate_mbps)
    return 2 * clock_error_ns + ceil(radio.range_m * S / LIGHT_M_PER_S) + overhang_ns
