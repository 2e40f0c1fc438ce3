"""The `[ground]` table: the post on the ground, a node without a vehicle."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from fanet_mw.scenario.tables.sections import Coordinate, Section


class Ground(Section):
    """A post on the ground: a node at a fixed place, with the id `nodes.count` + 1. It learns what the swarm finds and
    gives orders; `[[applications]]` may name it like any other node.
    """

    at_m: Annotated[tuple[Coordinate, ...], Field(max_length=2)] = ()
    """East and north of the post; empty: there is none."""
    antenna_m: Annotated[float, Field(ge=0.1, le=300)] = 5.0
    """Height of its antenna above ground."""
    gain_dbi: Annotated[float, Field(ge=0, le=30)] = 0.0
    """Gain of its antenna in the direction of any UAV, by which its links are stronger both ways. With `radio.channel =
    "range"` the reach grows as in free space, tenfold for 20 dBi."""

    @model_validator(mode="after")
    def _two_coordinates(self) -> Self:
        if len(self.at_m) == 1:
            raise ValueError(f"ground.at_m = {list(self.at_m)} must be [east, north], or [] for no post")
        return self
