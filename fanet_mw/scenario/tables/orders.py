"""The entries of a scenario's `[[orders]]`: what the post on the ground orders, and when."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from fanet_mw.orders import AROUND, Order, OrderKind
from fanet_mw.scenario.tables.sections import Coordinate, Duration, Id, Section

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
