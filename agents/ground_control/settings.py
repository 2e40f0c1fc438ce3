"""The parameters of a UAV that a ground station reads and writes: floats, with PX4's name where it has such a one."""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId

LONGEST_NAME: Final = 16
"""The bytes of a name in MAVLink."""


class Setting(NamedTuple):
    """One parameter: its default and its bounds."""

    name: str
    default: float
    least: float
    most: float
    mission_key: str = ""
    """The key of `[mission]` that it changes; empty for those of the flight controller."""


SPEED: Final = "MPC_XY_CRUISE"
"""Cruising speed of what an operator commands [m/s]."""
TAKEOFF_HEIGHT: Final = "MIS_TAKEOFF_ALT"
"""Height of a take-off that names none, over home [m]."""
RETURN_HEIGHT: Final = "RTL_RETURN_ALT"
"""Least height of a return, over home [m]."""
ACCEPTANCE: Final = "NAV_ACC_RAD"
"""A waypoint is reached within this distance [m]."""
FENCE_ACTION: Final = "GF_ACTION"
"""Beyond a fence that was uploaded: 0 nothing, 1 a warning, 2 hold, 3 return, 5 land (PX4's numbers)."""
SILENCE: Final = "COM_DL_LOSS_T"
"""An operator who is not heard for so long counts as lost [s]."""
SILENCE_ACTION: Final = "NAV_DLL_ACT"
"""What a UAV that flies by an operator's commands does then: 0 goes on, 1 holds, 2 returns, 3 lands (PX4's numbers)."""
RESERVE: Final = "SRCH_RESERVE"
"""The share of its charge with which a searching UAV comes home."""
LOST_LINK: Final = "SRCH_LINK_T"
"""A searching UAV that hears nobody for so long flies home [s]; 0: it searches on."""
SWEEPS: Final = "SRCH_SWEEPS"
"""After so many sweeps of the area the search ends; 0: it does not end by itself."""


def settings_of(scenario: Scenario, node: NodeId) -> Sequence[Setting]:
    """The parameters of a node, by name; what they are at the start is the scenario's."""
    mobility, mission = scenario.mobility, scenario.mission
    fastest = max(20.0, mobility.speed_m_s)
    return_m = mobility.return_height_m + (node - 1) * mobility.return_step_m
    return sorted([
        Setting(SPEED, min(fastest, max(0.5, mobility.speed_m_s)), 0.5, fastest),
        Setting(TAKEOFF_HEIGHT, min(1000.0, max(5.0, scenario.nodes.altitude_m)), 5.0, 1000.0),
        Setting(RETURN_HEIGHT, min(1000.0, return_m), 5.0, 1000.0),
        Setting(ACCEPTANCE, 3.0, 0.5, 200.0),
        Setting(FENCE_ACTION, 2.0, 0.0, 5.0),
        Setting(SILENCE, 10.0, 1.0, 300.0),
        Setting(SILENCE_ACTION, 1.0, 0.0, 3.0),
        *([
            Setting(RESERVE, mission.reserve_charge, 0.0, 1.0, "reserve_charge"),
            Setting(LOST_LINK, mission.lost_link_s, 0.0, 3600.0, "lost_link_s"),
            Setting(SWEEPS, mission.sweeps, 0.0, 1000.0, "sweeps"),
        ] if mission.search != "none" else []),
    ])  # fmt: skip


class Settings:
    """The values of the parameters now."""

    def __init__(self, known: Sequence[Setting]) -> None:
        self.known = tuple(known)
        self._values = {setting.name: setting.default for setting in known}

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def index(self, name: str) -> int | None:
        """The place of a parameter in the list; None if there is none of that name."""
        return next((at for at, setting in enumerate(self.known) if setting.name == name), None)

    def change(self, name: str, value: float) -> bool:
        """Set a parameter; False, and nothing changes, if none has that name or the value is out of bounds."""
        at = self.index(name)
        if at is None or not math.isfinite(value) or not self.known[at].least <= value <= self.known[at].most:
            return False
        self._values[name] = value
        return True
