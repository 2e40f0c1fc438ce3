"""The `fanet order` commands: parsing and printing; what they do is in `sim.bus.operator_commands`."""

from cyclopts import App

from fanet_mw.errors import ConfigError
from fanet_mw.orders import Order, OrderKind, wrong
from fanet_mw.units import MAX_NODES, S
from sim.cli.options import RUNNING, SwarmFlags
from sim.console import Console

app = App(
    name="order",
    group=RUNNING,
    help="Let the post on the ground of a swarm that runs order something: come home, stay over a place, search there, "
    "keep out of an area, end the search.",
)


@app.command
def recall(node: int = 0, *, where: SwarmFlags = SwarmFlags()) -> int:
    """Let a UAV, or all, fly home and land.

    Args:
        node: Node id; without it all UAVs.

    """
    return _give(Order(OrderKind.RECALL, node), where)


@app.command
def end(*, where: SwarmFlags = SwarmFlags()) -> int:
    """End the search: all UAVs fly home and land."""
    return _give(Order(OrderKind.END), where)


@app.command
def stay(east_m: float, north_m: float, *, node: int = 0, where: SwarmFlags = SwarmFlags()) -> int:
    """Let a UAV stay over a place, for example over a survivor.

    Args:
        east_m: East of the origin [m].
        north_m: North of the origin [m].
        node: Node id; without it the post chooses the nearest UAV that can best be spared.

    """
    return _give(Order(OrderKind.STAY, node, east_m, north_m), where)


@app.command
def search(east_m: float, north_m: float, radius_m: float, *, node: int = 0, where: SwarmFlags = SwarmFlags()) -> int:
    """Let a UAV search around a place.

    Args:
        east_m: East of the origin [m].
        north_m: North of the origin [m].
        radius_m: Up to this distance from the place [m].
        node: Node id; without it the post chooses the nearest UAV that can best be spared.

    """
    return _give(Order(OrderKind.SEARCH, node, east_m, north_m, radius_m), where)


@app.command
def release(node: int = 0, *, where: SwarmFlags = SwarmFlags()) -> int:
    """Let a UAV, or all, that were recalled or sent somewhere take part in the search again.

    Args:
        node: Node id; without it all UAVs.

    """
    return _give(Order(OrderKind.RELEASE, node), where)


@app.command(name="no-fly")
def no_fly(east_m: float, north_m: float, radius_m: float, *, where: SwarmFlags = SwarmFlags()) -> int:
    """Let all UAVs keep out of a circle, at any height.

    Args:
        east_m: Center, east of the origin [m].
        north_m: Center, north of the origin [m].
        radius_m: Radius [m].

    """
    return _give(Order(OrderKind.NO_FLY, 0, east_m, north_m, radius_m), where)


def _give(order: Order, where: SwarmFlags) -> int:
    from sim.bus.operator_commands import give

    name = order.kind.name.lower().replace("_", "-")
    if (why := wrong(order, uavs=MAX_NODES)) is not None:
        raise ConfigError(f"{name}: {why}")
    given = give(*where.located(), order, zenoh_config=where.zenoh_config)
    meant = f"node {given.other}" if given.other else "all"
    Console(highlight=False).print(f"order {given.serial}: {name}, {meant}, given at {given.t_ns / S:.3f} s")
    return 0
