"""The guard time of a slot: set by the scenario, or computed from clock error, propagation and frame length.

It is for slots with contention. Between the turns of a timetable the guard is called slack, as it is part of each turn
(`fanet_mw/timesync/turn_slack.py`).

The guard time is the silent end of a slot. It is kept where slots are laid out: no frame starts in it (`Superframe` in
`fanet_mw/routing/clustered/tdma/slot_timing.py`).
"""

from math import ceil
from typing import Final

from fanet_mw.airtime import OVERHEAD_BYTES, airtime_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import LIGHT_M_PER_S, MS, US

PLANNED_ERROR_NS: Final = 50 * US
"""The clock error that a plan before take-off assumes of synchronized clocks."""


def guard_ns(*, clock_error_ns: int, drift_ppm: float, resync_ns: int, range_m: float, overhang_ns: int) -> int:
    """The guard time that keeps the frames of two successive heads apart.

    Both clocks may be off by `clock_error_ns` when they are set, and drift apart at twice `drift_ppm` for `resync_ns`
    until they are set again. The last frame travels `range_m`, and ends `overhang_ns` after the last permitted start.
    """
    drift_ns = ceil(2 * drift_ppm * resync_ns / 1_000_000)
    return 2 * clock_error_ns + drift_ns + ceil(range_m * 1_000_000_000 / LIGHT_M_PER_S) + overhang_ns


def slot_guard_ns(scenario: Scenario, *, clock_error_ns: int) -> int:
    """The guard time of a slot; with `auto` it suffices for clocks that are at most `clock_error_ns` off at any time.

    `auto` allows for one data frame that starts at the slot's last instant. Relays that continue behind that frame are
    not allowed for, just as with a guard time that is given.
    """
    given_ms, radio = scenario.clusters.guard_ms, scenario.radio
    if given_ms != "auto":
        return round(given_ms * MS)
    overhang_ns = airtime_ns(scenario.traffic.payload_bytes + OVERHEAD_BYTES, radio, rate_mbps=radio.rate_mbps)
    return guard_ns(
        clock_error_ns=clock_error_ns, drift_ppm=0.0, resync_ns=0, range_m=radio.range_m, overhang_ns=overhang_ns
    )
