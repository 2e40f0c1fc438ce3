"""`[mobility]`: how UAVs move of which the mission asks nothing."""

from typing import Annotated, Any, Final

from pydantic import Field

from fanet_mw.extensions import Options, OptionsOf, PartName
from fanet_mw.scenario.sections import (
    Length,
    Section,
    Speed,
)

MOBILITY_MODELS: Final = ("static", "formation", "random_waypoint", "crossing", "onboard")


class Mobility(Section):
    """What a UAV does when the mission asks nothing of it."""

    model: Annotated[str, PartName("mobility.model", MOBILITY_MODELS)] = "static"
    """`formation` sweeps the area keeping the layout; `random_waypoint` is the statistical model, without pause;
    `crossing` flies each UAV through the middle of the area to the point opposite its start, and back.
    `onboard`: the world decides nothing, keeps no UAV clear of others, and flies what each UAV's computer asks for."""
    options: Annotated[dict[str, Any], OptionsOf("mobility.model", MOBILITY_MODELS)] = Field(default_factory=Options)
    """The table of a model that another package brings, as that package documents it."""
    speed_m_s: Speed = 7.5
    """Cruising speed."""
    see_m: Length = 50.0
    """UAVs nearer than this see each other without radio and keep clear; 0: they are blind."""
