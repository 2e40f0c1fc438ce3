"""The `[nodes]` table: how many nodes there are, and where they start; and `[[applications]]` of other packages that
they carry.
"""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from fanet_mw.extensions import OptionsOf, PartName
from fanet_mw.scenario.tables.sections import Coordinate, Count, Id, Length, Rate, Section, SomeLength
from fanet_mw.units import MAX_NODES


class Nodes(Section):
    """How many nodes there are and where they start. Node ids run from 1; node 1 is the leader."""

    count: Annotated[int, Field(ge=1, le=MAX_NODES)] = 45
    """Number of nodes; their ids are 1 to `count`."""
    layout: Literal["grid", "disc", "line", "explicit"] = "grid"
    """Where the nodes start: on a `grid`, at random places in a `disc`, on a `line`, or as `positions_m` states
    (`explicit`)."""
    spacing_m: SomeLength = 200.0
    """`grid` and `line`: distance between neighboring nodes."""
    radius_m: SomeLength = 100.0
    """`disc`: its radius."""
    columns: Count | None = None
    """`grid`: number of columns; by default the two factors of `count` that are nearest to the ratio of 9 x 5."""
    leader_at: Literal["first", "middle"] = "first"
    """`grid` and `line`: whether node 1, the leader, starts at the first place or at the one nearest to the middle; the
    others take the remaining places in order."""
    altitude_m: Length = 50.0
    """Height at which the nodes start and fly, with every layout but `explicit`."""
    on_ground: bool = False
    """Whether UAVs stand on the ground at the start; otherwise they start at `altitude_m`. UAVs of a planned search
    (`mission.search`) take off by themselves, straight up to `altitude_m` above their pads; others when an application
    commands it, which `mobility.model` must be `"onboard"` or `"static"` for."""
    telemetry_hz: Rate = 1.0
    """Rate of each node's MAVLink telemetry on its tap; 0 sends none."""
    positions_m: tuple[tuple[Coordinate, Coordinate, Coordinate], ...] = ()
    """`explicit`: [east, north, up] of each node."""

    @model_validator(mode="after")
    def _explicit_has_positions(self) -> Self:
        if self.layout == "explicit" and len(self.positions_m) != self.count:
            raise ValueError(
                f"nodes.positions_m has {len(self.positions_m)} entries; "
                f'layout = "explicit" needs nodes.count = {self.count}'
            )
        for index, (_, _, up_m) in enumerate(self.positions_m):
            if up_m < 0:
                raise ValueError(f"nodes.positions_m.{index}: up = {up_m:g} must be >= 0, the ground")
        return self


def grid_columns(count: int) -> int:
    """The number of columns of the default grid: the factors nearest to 9:5, otherwise the square root, rounded up."""
    wanted = math.sqrt(count * 9 / 5)
    divisors = [d for d in range(1, count + 1) if count % d == 0 and d * d >= count]
    best = min(divisors, key=lambda d: abs(d - wanted))
    return best if best <= 2 * wanted else math.ceil(wanted)


class ForeignApplication(Section):
    """An application of another package (documentation, how-to/extend), on board some or all UAVs."""

    use: Annotated[str, PartName("applications.use", ())]
    """The application: an entry point, or module and class."""
    nodes: Literal["all"] | tuple[Id, ...] = "all"
    """Ids of the nodes that carry it, or `all`."""
    options: Annotated[dict[str, Any], OptionsOf("applications.use", ())] = Field(default_factory=dict)
    """The application's own table, as its package documents it."""

    def on(self, node: int) -> bool:
        """True if a node carries it."""
        return self.nodes == "all" or node in self.nodes
