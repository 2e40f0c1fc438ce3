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


def bulk_report_bytes(scenario: Scenario) -> int:
    """The length of a survivor report that has no room of its own, because it is sent as bulk; 0 if there is none."""
    mission = scenario.mission
    return report_bytes(scenario) if mission.survivors and mission.report_priority == "bulk" else 0


def reserved(scenario: Scenario) -> Mapping[int, int]:
    """Bytes of each turn that bulk must leave free, by priority: one packet of each urgent class in use."""
    mission = scenario.mission
    found = {}
    if mission.collision_horizon_s:
        found[wire.PRIORITY_SAFETY] = WARNING_BYTES
    if mission.survivors and mission.report_priority != "bulk":
        priority = wire.PRIORITIES[mission.report_priority]
        found[priority] = max(report_bytes(scenario), found.get(priority, 0))
    return found
