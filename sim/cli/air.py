"""The `fanet air` commands: parsing and printing; what they do is in `sim.bus.operator_commands`."""

import math
from dataclasses import dataclass
from typing import Annotated

from cyclopts import App, Parameter

from fanet_mw.bus.radio_control import (
    JAM_LABEL,
    MAX_FOR_NS,
    PARTITION_LABEL,
    Control,
    Cut,
    Degrade,
    Jam,
    Mishap,
    MishapKind,
    Partition,
    Restore,
    link_label,
    node_label,
    require_valid,
)
from fanet_mw.errors import ConfigError
from fanet_mw.units import MAX_NODES, STILL, Enu, NodeId, S, seconds_to_ns
from sim.cli.options import RUNNING, SwarmFlags
from sim.console import Console

app = App(
    name="air",
    group=RUNNING,
    help="Change the air of a swarm that runs, or let something befall a UAV: degrade a link, jam an area, part the "
    "swarm, cut a node off, let one crash, restore.",
)


_Node = Annotated[int, Parameter(help="Node id.")]


@Parameter(name="*")
@dataclass(frozen=True)
class Life:
    """The label of the fault, and how long it lasts."""

    label: str | None = None
    """Label by which `restore` ends it; by default made from its kind and nodes. A fault ends an older one of
    its label."""
    for_s: Annotated[float, Parameter(name="--for")] = 0.0
    """How long the fault lasts [swarm s]; 0: until `fanet air restore`."""

    @property
    def for_ns(self) -> int:
        if not 0 <= self.for_s <= MAX_FOR_NS / S:  # also what is no number
            raise ConfigError(f"--for {self.for_s:g}: must be in [0, {MAX_FOR_NS / S:g}] s")
        return seconds_to_ns(self.for_s)


@app.command
def degrade(
    src: int,
    dst: int,
    *,
    loss_db: float = 0.0,
    loss_share: float = 0.0,
    one_way: Annotated[bool, Parameter(negative="")] = False,
    life: Life = Life(),
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Make a link weaker, or let it lose frames.

    Args:
        src: Node id of one end.
        dst: Node id of the other.
        loss_db: Added to the path loss [dB].
        loss_share: Share of frames lost, among those that would have been received.
        one_way: Only from src to dst.

    """
    label = life.label or link_label(src, dst)
    return _do(Degrade(label, NodeId(src), NodeId(dst), not one_way, loss_db, loss_share, life.for_ns), where)


@app.command
def jam(
    east_m: float,
    north_m: float,
    radius_m: float,
    *,
    noise_dbm: float | None = None,
    life: Life = Life(),
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Jam the receivers in a circle, at any height.

    Args:
        east_m: Center, east of the origin [m].
        north_m: Center, north of the origin [m].
        radius_m: Radius [m].
        noise_dbm: Noise at each receiver inside [dBm]; by default nothing can be received there.

    """
    center = Enu(east_m, north_m, 0.0)
    noise = math.inf if noise_dbm is None else noise_dbm
    return _do(Jam(life.label or JAM_LABEL, center, radius_m, noise, life.for_ns), where)


@app.command
def cut(node: _Node, *, life: Life = Life(), where: SwarmFlags = SwarmFlags()) -> int:
    """Switch a node's radio off."""
    return _do(Cut(life.label or node_label(node), NodeId(node), life.for_ns), where)


@app.command
def mute(node: _Node, *, life: Life = Life(), where: SwarmFlags = SwarmFlags()) -> int:
    """Let a node's radio receive, and send nothing."""
    return _do(Cut(life.label or node_label(node), NodeId(node), life.for_ns, hears=True), where)


@app.command
def deaf(node: _Node, *, life: Life = Life(), where: SwarmFlags = SwarmFlags()) -> int:
    """Let a node's radio send, and receive nothing."""
    return _do(Cut(life.label or node_label(node), NodeId(node), life.for_ns, sends=True), where)


@app.command
def partition(
    east_m: float,
    north_m: float,
    other_east_m: float,
    other_north_m: float,
    *,
    life: Life = Life(),
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Let no frame pass a line on the map.

    Args:
        east_m: East of one point of the line [m].
        north_m: North of that point [m].
        other_east_m: East of another point of the line [m].
        other_north_m: North of that point [m].

    """
    line = (east_m, north_m, other_east_m, other_north_m)
    return _do(Partition(life.label or PARTITION_LABEL, (), line, life.for_ns), where)


@app.command
def crash(node: _Node, *, where: SwarmFlags = SwarmFlags()) -> int:
    """Let a UAV's motors stop for good; its radio dies on the ground."""
    return _do(Mishap(node_label(node), NodeId(node), MishapKind.CRASH, STILL), where)


@app.command
def battery(node: _Node, charge: float, *, where: SwarmFlags = SwarmFlags()) -> int:
    """Take charge from a UAV's battery.

    Args:
        charge: Share of the capacity that is left, at most.

    """
    return _do(Mishap(node_label(node), NodeId(node), MishapKind.BATTERY, Enu(charge, 0.0, 0.0)), where)


@app.command
def gps(
    node: _Node,
    *,
    offset_m: tuple[float, float, float] | None = None,
    life: Life = Life(),
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Let a UAV's GPS receiver give no position, or a wrong one.

    Args:
        offset_m: By how much it is wrong: east, north, up [m]; by default it gives no position.

    """
    what = MishapKind.GPS_OFF if offset_m is None else MishapKind.GPS
    value = STILL if offset_m is None else Enu(*offset_m)
    return _do(Mishap(life.label or node_label(node), NodeId(node), what, value, life.for_ns), where)


@app.command
def restore(label: str = "", *, where: SwarmFlags = SwarmFlags()) -> int:
    """End a fault, or all of them.

    Args:
        label: Label of the fault: the one given with it, or link-SRC-DST, node-ID, jam. Without a label, all faults
            end.

    """
    return _do(Restore(label), where)


def _do(control: Control, where: SwarmFlags) -> int:
    from sim.bus.operator_commands import change

    if not isinstance(control, Restore):
        require_valid(control, count=MAX_NODES)
    console = Console(highlight=False)
    for fault in change(*where.located(), control, zenoh_config=where.zenoh_config):
        console.print(f"{fault.label}: {fault.kind} {'since' if fault.active else 'ended at'} {fault.t_ns / S:.3f} s")
    return 0
