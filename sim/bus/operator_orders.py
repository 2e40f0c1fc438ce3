"""`fanet order`: asks the post of a running swarm to give an order, and waits until its trace shows that it has."""

from pathlib import Path
from typing import Final

from fanet_mw.bus.topics import Topics
from fanet_mw.errors import FanetError
from fanet_mw.hosts.bus import Bus, config_of
from fanet_mw.orders import Order
from fanet_mw.trace import Ordered, Record
from sim.bus.air_control import CONFIRM_TIMEOUT_S, OPERATOR, find_swarm, put_and_watch, scenario_of_swarm

_ALL: Final = "*"


def give(endpoint: str, swarm: str | None, order: Order, *, zenoh_config: Path | None = None) -> Ordered:
    """Give an order; returns what the post has recorded of it. Raises BusError without a router, else FanetError."""
    with Bus.join(endpoint, config_of(zenoh_config, OPERATOR)) as bus:
        names = Topics(swarm or find_swarm(bus))
        tree = scenario_of_swarm(bus, names)
        count = tree.get("nodes", {}).get("count")
        if tree and not tree.get("ground", {}).get("at_m"):
            raise FanetError(f"swarm {names.swarm} has no post on the ground: its scenario has no ground.at_m")
        if isinstance(count, int) and order.node > count:
            raise FanetError(f"node {order.node}: the UAVs of swarm {names.swarm} are 1 to {count}")

        def confirms(record: Record) -> bool:
            return (
                isinstance(record, Ordered)
                and record.order == order.kind.name.lower()
                and order.node in (0, record.other)
            )

        trace = names.trace(_ALL if not isinstance(count, int) else f"agent-{count + 1}")
        for record in put_and_watch(bus, names.orders, order, trace, confirms):
            if isinstance(record, Ordered):
                return record
        raise FanetError(
            f"the post did not give the order within {CONFIRM_TIMEOUT_S:g} s: refused (`orders_refused` in its "
            f"report: no UAV that takes part has been heard), or no post on {names.orders}"
        )
