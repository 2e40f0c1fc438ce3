"""The room that each turn of a timetable reserves for packets that are more urgent than bulk.

A turn reserves room for one packet of each urgent class that the scenario uses: a collision warning, a survivor report.
The lengths of these packets are known before take-off. `turn_release.py` fills the room.
"""

from collections.abc import Mapping
from typing import Final

from fanet_mw import wire
from fanet_mw.scenario import Scenario

WARNING_BYTES: Final = wire.HEADER_BYTES + 19 + wire.OVERHEAD
"""MAVLink's COLLISION has 19 bytes (common.xml)."""
_REPORT_BYTES: Final = wire.HEADER_BYTES + wire.SURVIVOR.layout.size + wire.OVERHEAD


def report_bytes(scenario: Scenario) -> int:
    """The length of a packet with a survivor report."""
    return scenario.mission.report_bytes or _REPORT_BYTES


def reserved(scenario: Scenario) -> Mapping[int, int]:
    """Bytes of each turn that bulk must leave free, by priority: one packet of each urgent class in use."""
    found = {}
    if scenario.mission.collision_horizon_s:
        found[wire.PRIORITY_SAFETY] = WARNING_BYTES
    if scenario.mission.survivors:
        found[wire.PRIORITY_REPORT] = report_bytes(scenario)
    return found
