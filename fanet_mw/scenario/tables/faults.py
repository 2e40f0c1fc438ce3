"""The entries of a scenario's `[[faults]]`: what happens to the air or to a UAV at an instant of the run."""

import math
from collections.abc import Iterable
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from fanet_mw.bus.radio_control import (
    EVERY,
    JAM_LABEL,
    MAX_LABEL,
    MAX_LOSS_DB,
    MAX_NOISE_DBM,
    MAX_RADIUS_M,
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
)
from fanet_mw.scenario.tables.sections import Coordinate, Duration, Id, Section
from fanet_mw.units import STILL, Enu, NodeId, seconds_to_ns


class FaultSection(Section):
    """The base of the entries of `[[faults]]`: something that happens at an instant of the run."""

    at_s: Duration
    """The swarm time at which it begins."""
    for_s: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    """How long it lasts; 0: until it is restored. A crash, and what a battery has lost, are for good."""
    label: Annotated[str, Field(max_length=MAX_LABEL, pattern=r"^[ -~]*$")] = ""
    """The name by which `restore` ends it; by default `node-N` whatever befalls node N, `link-SRC-DST`, `links`, `jam`
    or `partition`. A new fault ends an old one with the same label."""

    @property
    def for_ns(self) -> int:
        return seconds_to_ns(self.for_s)


class DegradeFault(FaultSection):
    """A link, or every link, is weaker or loses frames."""

    kind: Literal["degrade"]
    """`degrade`: a link, or every link, is weaker or loses frames."""
    src: Id | None = None
    """Node id of one end of the link; with neither end every link is degraded."""
    dst: Id | None = None
    """Node id of the other end."""
    both: bool = True
    """Whether the other direction of the link is degraded, too."""
    loss_db: Annotated[float, Field(ge=0, le=MAX_LOSS_DB)] = 0.0
    """Loss that is added to the path loss."""
    loss_share: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Share of frames that are lost, among those that would have been received."""

    @model_validator(mode="after")
    def _ends_are_two_or_none(self) -> Self:
        if (self.src is None) != (self.dst is None):
            raise ValueError("src and dst must both be given, for a link, or neither, for every link")
        return self

    def control(self) -> Control:
        ends = NodeId(self.src or EVERY), NodeId(self.dst or EVERY)
        label = self.label or link_label(*ends)
        return Degrade(label, *ends, self.both, self.loss_db, self.loss_share, self.for_ns)


class JamFault(FaultSection):
    """An area is jammed."""

    kind: Literal["jam"]
    """`jam`: an area is jammed."""
    center_m: tuple[Coordinate, Coordinate]
    """Center of the circle: east, north."""
    radius_m: Annotated[float, Field(gt=0, le=MAX_RADIUS_M)]
    """Radius of the circle, at any height."""
    noise_dbm: Annotated[float, Field(ge=-MAX_LOSS_DB, le=MAX_NOISE_DBM)] | None = None
    """Noise at each receiver inside; by default nothing can be received there."""

    def control(self) -> Control:
        noise_dbm = math.inf if self.noise_dbm is None else self.noise_dbm
        return Jam(self.label or JAM_LABEL, Enu(*self.center_m, 0.0), self.radius_m, noise_dbm, self.for_ns)


class CutFault(FaultSection):
    """A node's radio is off."""

    kind: Literal["cut"]
    """`cut`: a node's radio is off."""
    node: Id
    """Id of that node."""

    def control(self) -> Control:
        return Cut(self.label or node_label(self.node), NodeId(self.node), self.for_ns)


class _NodeFault(FaultSection):
    """The base of faults of one UAV."""

    node: Id
    """Id of that node."""

    def _mishap(self, what: MishapKind, value: Enu = STILL) -> Control:
        return Mishap(self.label or node_label(self.node), NodeId(self.node), what, value, self.for_ns)


class MuteFault(_NodeFault):
    """A node's radio does not send."""

    kind: Literal["mute"]
    """`mute`: a node's radio does not send; it receives."""

    def control(self) -> Control:
        return Cut(self.label or node_label(self.node), NodeId(self.node), self.for_ns, hears=True)


class DeafFault(_NodeFault):
    """A node's radio does not receive."""

    kind: Literal["deaf"]
    """`deaf`: a node's radio does not receive; it sends."""

    def control(self) -> Control:
        return Cut(self.label or node_label(self.node), NodeId(self.node), self.for_ns, sends=True)


class PartitionFault(FaultSection):
    """The swarm is parted: no frame passes from one side to the other."""

    kind: Literal["partition"]
    """`partition`: no frame passes from one side to the other."""
    nodes: tuple[Id, ...] = ()
    """Ids of the nodes on one side; or `line_m`."""
    line_m: tuple[tuple[Coordinate, Coordinate], tuple[Coordinate, Coordinate]] | None = None
    """Two points, each east and north, of a line that parts the map; which side a UAV is on changes as it flies."""

    @model_validator(mode="after")
    def _sides_are_given_once(self) -> Self:
        if bool(self.nodes) == (self.line_m is not None):
            raise ValueError("either nodes or line_m must be given")
        if self.line_m is not None and self.line_m[0] == self.line_m[1]:
            raise ValueError(f"line_m = {[list(point) for point in self.line_m]} must be two different points")
        return self

    def control(self) -> Control:
        (east, north), (other_east, other_north) = self.line_m or ((0.0, 0.0), (0.0, 0.0))
        group = tuple(NodeId(node) for node in self.nodes)
        return Partition(self.label or PARTITION_LABEL, group, (east, north, other_east, other_north), self.for_ns)


class CrashFault(_NodeFault):
    """A UAV's motors stop."""

    kind: Literal["crash"]
    """`crash`: a UAV's motors stop for good; it falls, and its radio dies on the ground."""

    def control(self) -> Control:
        return self._mishap(MishapKind.CRASH)


class BatteryFault(_NodeFault):
    """A UAV's battery loses charge."""

    kind: Literal["battery"]
    """`battery`: a UAV's battery has less charge than it should; needs `sensors.battery_hz`."""
    charge: Annotated[float, Field(ge=0, le=1)]
    """The share of the capacity that is left, at most."""

    def control(self) -> Control:
        return self._mishap(MishapKind.BATTERY, Enu(self.charge, 0.0, 0.0))


class GpsFault(_NodeFault):
    """A UAV's GPS receiver is wrong, or gives no position."""

    kind: Literal["gps"]
    """`gps`: a UAV's receiver is wrong, or gives no position."""
    offset_m: tuple[Coordinate, Coordinate, Coordinate] | None = None
    """By which it is wrong: east, north, up; by default it gives no position."""

    def control(self) -> Control:
        if self.offset_m is None:
            return self._mishap(MishapKind.GPS_OFF)
        return self._mishap(MishapKind.GPS, Enu(*self.offset_m))


class StopFault(_NodeFault):
    """A UAV's program ends."""

    kind: Literal["stop"]
    """`stop`: a UAV's program ends; with `for_s` it is started again after that time, and knows nothing."""

    def control(self) -> Control:
        return self._mishap(MishapKind.STOP)


class RestoreFault(Section):
    """The end of a fault, or of all faults (without a label)."""

    kind: Literal["restore"]
    """`restore`: the end of a fault."""
    at_s: Duration
    """The swarm time at which the fault ends."""
    label: str = ""
    """Label of that fault, given or by default; without a label all faults end."""

    def control(self) -> Control:
        return Restore(self.label)


AnyFault = Annotated[
    DegradeFault
    | JamFault
    | CutFault
    | MuteFault
    | DeafFault
    | PartitionFault
    | CrashFault
    | BatteryFault
    | GpsFault
    | StopFault
    | RestoreFault,
    Field(discriminator="kind"),
]


def stops_of(planned: Iterable[tuple[int, Control]], node: int) -> list[tuple[int, int | None]]:
    """When the program of a node ends [ns], and when it is started again; None if it is not. Labels end faults as they
    do on the air, and several faults may stop it at once; `planned` may have any order of time.
    """
    standing: dict[str, tuple[int, float]] = {}
    spans: list[tuple[int, float]] = []
    for at_ns, control in sorted(planned, key=lambda one: one[0]):
        for label in [control.label] if control.label else [*standing]:
            if label in standing:
                begins_ns, ends_ns = standing.pop(label)
                spans.append((begins_ns, min(ends_ns, at_ns)))
        if isinstance(control, Mishap) and control.what is MishapKind.STOP and control.node == node:
            standing[control.label] = at_ns, at_ns + control.for_ns if control.for_ns else math.inf
    together: list[tuple[int, float]] = []
    for begins_ns, ends_ns in sorted([*spans, *standing.values()]):
        if together and begins_ns <= together[-1][1]:
            begins_ns, before_ns = together.pop()
            ends_ns = max(before_ns, ends_ns)
        together.append((begins_ns, ends_ns))
    return [(begins_ns, None if ends_ns == math.inf else int(ends_ns)) for begins_ns, ends_ns in together]
