"""Where PX4 and ArduPilot differ: the numbers of their flight modes, and how they count missions and heights.

On board all is PX4's; a gateway with another flavor translates (`fanet_mw/gateway/translation.py`).
"""

from enum import StrEnum
from types import MappingProxyType
from typing import Final


class Flavor(StrEnum):
    """Whose numbers a ground station, or a flight controller, uses."""

    PX4 = "px4"
    ARDUPILOT = "ardupilot"


class Mode(StrEnum):
    """What a UAV does, as a ground station sees it."""

    HOLD = "hold"
    TAKEOFF = "takeoff"
    MISSION = "mission"
    """It flies the mission that an operator has uploaded; without one, the swarm's own task."""
    RETURN = "return"
    LAND = "land"
    GUIDED = "guided"
    """An operator's setpoints fly it."""


_AUTO: Final = 4 << 16
PX4_NUMBERS: Final = MappingProxyType({
    Mode.TAKEOFF: _AUTO | 2 << 24,
    Mode.HOLD: _AUTO | 3 << 24,
    Mode.MISSION: _AUTO | 4 << 24,
    Mode.RETURN: _AUTO | 5 << 24,
    Mode.LAND: _AUTO | 6 << 24,
    Mode.GUIDED: 6 << 16,
})  # fmt: skip
"""HEARTBEAT.custom_mode of PX4: main mode in the third byte, sub mode in the fourth (px4_custom_mode.h)."""
ARDUPILOT_NUMBERS: Final = MappingProxyType({
    Mode.TAKEOFF: 4, Mode.HOLD: 5, Mode.MISSION: 3, Mode.RETURN: 6, Mode.LAND: 9, Mode.GUIDED: 4,
})  # fmt: skip
"""HEARTBEAT.custom_mode of ArduPilot's Copter (mode.h)."""
_OF_PX4: Final = {number: mode for mode, number in PX4_NUMBERS.items()}
_OF_ARDUPILOT: Final = {number: mode for mode, number in ARDUPILOT_NUMBERS.items()} | {17: Mode.HOLD}  # BRAKE


def mode_of(number: int, flavor: Flavor = Flavor.PX4) -> Mode | None:
    """The mode that a custom mode stands for; None for one that a swarm's UAVs do not have."""
    return (_OF_PX4 if flavor is Flavor.PX4 else _OF_ARDUPILOT).get(number)


def number_of(mode: Mode, flavor: Flavor = Flavor.PX4) -> int:
    return (PX4_NUMBERS if flavor is Flavor.PX4 else ARDUPILOT_NUMBERS)[mode]
