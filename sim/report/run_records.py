"""The trace of one run, as the pictures of its page need it."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from agents.applications.traffic import targets_of
from fanet_mw.errors import ConfigError
from fanet_mw.scenario.model import Scenario
from fanet_mw.trace import (
    Approaching,
    Arrived,
    BoundStated,
    Confirmed,
    Delivered,
    Detected,
    Generated,
    KnownOnGround,
    LetOut,
    PlacedAmong,
    PlacedInside,
    Posed,
    Record,
    Refuted,
    RoleChanged,
)
from fanet_mw.units import Enu, S
from sim.results.links_over_time import heard_between_m
from sim.world.arrays import Values
from sim.world.environment.layout import positions
from sim.world.environment.survivors import place

SHOWN: Final = (
    Generated, Delivered, BoundStated, LetOut, RoleChanged, Detected, Approaching, Arrived, Confirmed, PlacedInside,
    PlacedAmong, Refuted, KnownOnGround, Posed,
)  # fmt: skip
"""The kinds of records that the pictures are drawn from."""
_WINDOW_NS: Final = 10 * S
"""The length of the time for which the map of the links shows the UAVs."""


class PlacesOnMap(NamedTuple):
    """The places of the nodes on the map of the links, by id."""

    at: Mapping[int, tuple[float, float]]
    said: str
    """The instant at which the UAVs were at these places, in words for the caption."""
    moved: bool
    """True if UAVs flew during the run, so that links differ from one time to another."""


@dataclass(slots=True)
class RunRecords:
    """The records of a trace, sorted by what the pictures show."""

    scenario: Scenario
    sent: dict[tuple[int, int], int] = field(default_factory=dict)
    """The instant at which each packet of the first load was generated."""
    bounds: dict[tuple[int, int], int] = field(default_factory=dict)
    delivered: list[Delivered] = field(default_factory=list)
    reports: dict[tuple[int, int], int] = field(default_factory=dict)
    """The instant at which each report of a survivor was generated."""
    reports_delivered: list[Delivered] = field(default_factory=list)
    let_out: list[LetOut] = field(default_factory=list)
    heads: dict[int, int] = field(default_factory=dict)
    roles: dict[int, list[RoleChanged]] = field(default_factory=lambda: defaultdict(list))
    """The roles of each node, in the order of time."""
    mission: list[
        Detected | Approaching | Arrived | Confirmed | PlacedInside | PlacedAmong | Refuted | KnownOnGround
    ] = field(default_factory=list)
    tracks: dict[int, list[Posed]] = field(default_factory=lambda: defaultdict(list))
    """The positions of each UAV, once a second."""
    survivors: Sequence[Enu] = ()
    """The true places of the survivors, in the order of their ids."""
    unplaced: str = ""
    """Why the survivors' places are not known any more; empty if they are."""
    _heard_m: Values | None = None
    """The reach of the radio between each two nodes; None until somebody asks."""

    def read(self, records: Iterable[Record]) -> None:
        """Take in all records of these kinds; to be called once."""
        had: set[tuple[int, int, int]] = set()
        load = next(iter(self.scenario.traffic_classes))
        for record in records:
            match record:
                case Posed():
                    self.tracks[record.node].append(record)
                case Generated() if record.app == load:
                    self.sent[record.node, record.seq] = record.t_ns
                case Generated() if record.app == "report":
                    self.reports[record.node, record.seq] = record.t_ns
                case Delivered() if (record.node, record.origin, record.seq) not in had:
                    had.add((record.node, record.origin, record.seq))
                    self.delivered.append(record)
                case BoundStated():
                    self.bounds[record.node, record.seq] = record.bound_ns
                case LetOut():
                    self.let_out.append(record)
                case RoleChanged():
                    self.heads[record.node] = record.head
                    self.roles[record.node].append(record)
                case (
                    Detected()
                    | Approaching()
                    | Arrived()
                    | Confirmed()
                    | PlacedInside()
                    | PlacedAmong()
                    | Refuted()
                    | KnownOnGround()
                ):
                    self.mission.append(record)
        targets = {node: set(self.targets(node)) for node in self.scenario.node_ids}
        self.reports_delivered = [
            one for one in self.delivered if (one.origin, one.seq) in self.reports and one.node != one.origin
        ]
        self.delivered = [
            one for one in self.delivered if (one.origin, one.seq) in self.sent and one.node in targets[one.origin]
        ]
        try:
            self.survivors = place(self.scenario)
        except ConfigError as error:
            self.unplaced = str(error)

    def targets(self, origin: int) -> Sequence[int]:
        """The nodes for which the load of a node is meant."""
        return targets_of(self.scenario, origin)

    def flown(self) -> Iterable[tuple[float, float, float]]:
        """The positions of all UAVs, in no order of time [m]."""
        return ((one.east_m, one.north_m, one.up_m) for track in self.tracks.values() for one in track)

    def reach_m(self, a: int, b: int) -> float:
        """How far the radio of one node is heard by that of another; the antenna of the post may have a gain."""
        if self._heard_m is None:
            self._heard_m = heard_between_m(self.scenario)
        return float(self._heard_m[a - 1, b - 1])

    @property
    def searches(self) -> bool:
        """True if the run has a mission: people to be found, or an area to be searched."""
        return self.scenario.mission.survivors > 0 or self.scenario.mission.search != "none"

    @property
    def end_s(self) -> float:
        """The last instant for which there are positions, or else the end of the scenario [s]."""
        last_ns = max((track[-1].t_ns for track in self.tracks.values()), default=0)
        return last_ns / S if last_ns else self.scenario.duration_s

    def places(self) -> PlacesOnMap:
        """The mean place of each UAV in the last seconds of the load, or where it was placed if nobody flew; and that
        of the post.
        """
        starts = {node: (at.east, at.north) for node, at in enumerate(positions(self.scenario), 1)}
        if not any(_length(track) > 1.0 for track in self.tracks.values()):
            return PlacesOnMap(starts, "where they stood during the whole run", moved=False)
        end_ns = min(self.scenario.traffic_window_ns[1], round(self.end_s * S))
        start_ns = max(0, end_ns - _WINDOW_NS)
        within = {node: [one for one in track if start_ns <= one.t_ns <= end_ns] for node, track in self.tracks.items()}
        mean = {
            node: (sum(one.east_m for one in seen) / len(seen), sum(one.north_m for one in seen) / len(seen))
            for node, seen in within.items()
            if seen
        }
        mean |= {post: starts[post] for post in [self.scenario.post] if post is not None}
        return PlacesOnMap(mean, f"at their mean places from {start_ns / S:g} to {end_ns / S:g} s", moved=True)


def _length(track: Sequence[Posed]) -> float:
    """The extent of a track on the map [m]."""
    east, north = [one.east_m for one in track], [one.north_m for one in track]
    return max(max(east) - min(east), max(north) - min(north))
