"""The `[ground]` table: the post on the ground, a node without a vehicle; and `[[orders]]` that it gives."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from fanet_mw.orders import AROUND, Order, OrderKind
from fanet_mw.scenario.tables.sections import Coordinate, Duration, Id, Section


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


_WITH_PLACE = (OrderKind.STAY, OrderKind.SEARCH, OrderKind.NO_FLY)


class PlannedOrder(Section):
    """An order that the post on the ground (`[ground]`) gives; `fanet order` gives orders while a swarm runs."""

    at_s: Duration
    """The swarm time at which it is given."""
    order: Literal["recall", "end", "stay", "search", "release", "no_fly"]
    """`recall`: fly home and land; `end`: all do, the search is over; `stay`: over a place; `search`: around a place,
    up to `radius_m`; `release`: take part in the search again; `no_fly`: all keep out of a circle."""
    node: Id | None = None
    """The UAV that is meant; without it all are, and of `stay` and `search` the nearest that can best be spared."""
    place_m: Annotated[tuple[Coordinate, ...], Field(max_length=2)] = ()
    """East and north of the place, for `stay`, `search` and `no_fly`."""
    radius_m: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    """Radius around the place, for `search` and `no_fly`."""

    @property
    def what(self) -> Order:
        east_m, north_m = self.place_m or (0.0, 0.0)
        return Order(OrderKind[self.order.upper()], self.node or 0, east_m, north_m, self.radius_m)

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> Self:
        kind = OrderKind[self.order.upper()]
        if len(self.place_m) != 2 * (kind in _WITH_PLACE):
            wanted = "[east, north]" if kind in _WITH_PLACE else "left out"
            raise ValueError(f"orders: place_m = {list(self.place_m)} of {self.order} must be {wanted}")
        if (self.radius_m > 0) != (kind in AROUND):
            bound = "> 0" if kind in AROUND else "left out"
            raise ValueError(f"orders: radius_m = {self.radius_m:g} of {self.order} must be {bound}")
        return self
