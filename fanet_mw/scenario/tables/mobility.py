"""The `[mobility]` table: how UAVs move as long as the mission does not decide it."""

from typing import Annotated, Any, Final, Literal

from pydantic import Field

from fanet_mw.extensions import Options, OptionsOf, PartName
from fanet_mw.scenario.tables.sections import Duration, Length, Section

MOBILITY_MODELS: Final = ("static", "formation", "random_waypoint", "crossing", "onboard")
_RIGID: Final = ("static", "formation")


class Mobility(Section):
    """How a UAV moves as long as the mission does not decide it."""

    model: Annotated[str, PartName("mobility.model", MOBILITY_MODELS)] = "static"
    """`static` UAVs stay where they are; in `formation` they sweep the area and keep their layout; with
    `random_waypoint` they fly from one random waypoint to the next without pauses; with `crossing` each flies through
    the middle of the area to the point opposite its start, and back. With `onboard` the world only carries out what
    each UAV's computer commands, and keeps no UAV clear of others."""
    options: Annotated[dict[str, Any], OptionsOf("mobility.model", MOBILITY_MODELS)] = Field(default_factory=Options)
    """The options of a model from another package, as that package documents them."""
    speed_m_s: Annotated[float, Field(ge=0, le=60)] = 7.5
    """Cruising speed. A vehicle of `rotors` flies as fast as its tilt limit lets it, and no faster."""
    see_m: Length = 50.0
    """Within this distance the world keeps UAVs clear of each other, without any radio; 0: it does not."""
    return_after_s: Duration = 0.0
    """`onboard`: a UAV whose computer has died, so that its last setpoint is older than this while it flies, returns to
    its start, flown by its flight controller alone: it climbs to `return_height_m`, flies there straight at
    `speed_m_s`, and lands; the next setpoint takes over from it. Computers repeat their last setpoint three times as
    often. 0: it holds its position."""
    return_height_m: Annotated[float, Field(ge=5, le=1000)] = 100.0
    """The least height at which a UAV returns, above the ground at the highest start of all UAVs; none sinks on its
    way. It should clear every obstacle."""
    return_step_m: Annotated[float, Field(ge=0, le=100)] = 3.0
    """UAV 1 returns at `return_height_m`, and each other one this much higher than the one with the next lower id, so
    that UAVs that return at once do not meet on their ways. 0: all return at the same height."""
    geofence: Literal["brake", "return"] = "brake"
    """`onboard`: what becomes of a UAV whose velocity setpoints take it to the geofence, 50 m outside the area: it
    brakes before it, or it returns as soon as it is beyond, and obeys no setpoint until it has landed."""

    @property
    def rigid(self) -> bool:
        """True if no distance between UAVs changes."""
        return self.model in _RIGID or self.speed_m_s == 0
