"""The formation of a search: its shape and its dimensions together, and the formation that fits a number of UAVs.

The words place, team, lane, relay and follower are explained in `shapes/contract.py`.
"""

from collections.abc import Callable, Mapping
from typing import Final, assert_never

from agents.mission.search_formation.shapes import lines, sectors, spiral
from agents.mission.search_formation.shapes.contract import Demands, Dimensions, Shape, ShapeName
from agents.mission.search_formation.shapes.lines import Lines
from agents.mission.search_formation.shapes.sectors import Sectors
from agents.mission.search_formation.shapes.spiral import Spiral
from fanet_mw.units import STILL, Enu
from fanet_mw.wire.search_plan import MOST_PLACES

_SHAPES: Final[Mapping[ShapeName, Callable[[Dimensions], Shape]]] = {
    ShapeName.LINES: Lines,
    ShapeName.SPIRAL: Spiral,
    ShapeName.SECTORS: Sectors,
}
_STEP_S: Final = 0.05
"""The time step over which the velocity of a place is computed."""


class Pattern:
    """A formation, and the position of each of its places over time."""

    def __init__(self, dimensions: Dimensions) -> None:
        self.dimensions = dimensions
        self.shape = _SHAPES[dimensions.shape](dimensions)

    @property
    def places(self) -> int:
        """The number of places: team by team, then relays, then followers."""
        return self.dimensions.places

    @property
    def followers(self) -> range:
        """The places without which the swarm stays connected."""
        return range(self.dimensions.fixed, self.dimensions.places)

    def line(self, place: int) -> range:
        """The places of the team of a place, lane by lane."""
        return self.dimensions.line(self.dimensions.team_of(place))

    def kind(self, place: int) -> str:
        """The kind of a place: `line` for one of any team, `relay` or `follower`."""
        if place < self.dimensions.fixed - self.dimensions.relays:
            return "line"
        return "relay" if place < self.dimensions.fixed else "follower"

    def at(self, place: int, swept_s: float) -> Enu:
        """The position of a place after this time of sweeping; before 0, where the sweep begins."""
        return self.shape.at(place, swept_s)

    def velocity(self, place: int, swept_s: float) -> Enu:
        """The velocity of a place after this time of sweeping."""
        if swept_s < 0:
            return STILL
        early = max(0.0, swept_s - _STEP_S)
        a, b = self.at(place, early), self.at(place, early + _STEP_S)
        return Enu((b.east - a.east) / _STEP_S, (b.north - a.north) / _STEP_S, (b.up - a.up) / _STEP_S)


def fitted(
    count: int, demands: Demands, *, shape: ShapeName = ShapeName.LINES, sectors_wanted: int = 1
) -> Pattern | None:
    """The formation of a shape for this number of UAVs; None if they are too few. UAVs for whom a plan message has no
    room get no place.
    """
    count = min(count, MOST_PLACES)
    match shape:
        case ShapeName.LINES:
            made = lines.fitted(count, demands)
        case ShapeName.SPIRAL:
            made = spiral.fitted(count, demands)
        case ShapeName.SECTORS:
            made = sectors.fitted(count, sectors_wanted, demands)
        case _:
            assert_never(shape)
    return None if made is None else Pattern(made)
