"""The scenario: one frozen model of all that a run depends on. Keys have units that people use, named in the key.

A key is a contract with users, because renaming it breaks their files and sweeps. Derived values are properties, in
integer nanoseconds.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from fanet_mw.bus.radio_control import Control
from fanet_mw.scenario.cross_checks import disagreements
from fanet_mw.scenario.tables.clock import Clock
from fanet_mw.scenario.tables.clusters import Clusters
from fanet_mw.scenario.tables.faults import AnyFault, stops_of
from fanet_mw.scenario.tables.ground import Ground, PlannedOrder
from fanet_mw.scenario.tables.mission import Mission
from fanet_mw.scenario.tables.mobility import Mobility
from fanet_mw.scenario.tables.nodes import ForeignApplication, Nodes
from fanet_mw.scenario.tables.radio import Radio
from fanet_mw.scenario.tables.routing import Rounds, Routing
from fanet_mw.scenario.tables.sections import Duration, Section, SomeTime
from fanet_mw.scenario.tables.sensors import Sensors
from fanet_mw.scenario.tables.traffic import Traffic
from fanet_mw.scenario.tables.world import World
from fanet_mw.units import MS, NodeId, seconds_to_ns

_REPAIR_S: Final = 10.0
"""The time for which packets are repaired by default where floods lose frames."""
_LIFETIME_MS: Final = 500.0
_FOREVER_MS: Final = 1e6


class Scenario(Section):
    """A scenario file; one execution of it with one seed is a run."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,64}$")] = "unnamed"
    """Name of the scenario, and of its swarm on the bus; by default the name of the file."""
    description: str = ""
    """One sentence for the list of `fanet scenarios`."""
    duration_s: SomeTime = 100.0
    """Length of a run, in swarm time."""
    warmup_s: Duration = 0.0
    """The instant at which application traffic, and the measurement, begin."""
    drain_s: Duration = 0.0
    """How long before the end application traffic ends, so that packets under way can still arrive."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    """Seed of all random streams: the same scenario and seed give the same trace, byte by byte."""
    time_scale: Annotated[float, Field(ge=1e-3, le=100)] = 1.0
    """Real time only: swarm seconds per wall-clock second."""
    nodes: Nodes = Nodes()
    ground: Ground = Ground()
    traffic: Traffic = Traffic()
    routing: Routing = Routing()
    clusters: Clusters = Clusters()
    rounds: Rounds = Rounds()
    radio: Radio = Radio()
    mobility: Mobility = Mobility()
    clock: Clock = Clock()
    world: World = World()
    mission: Mission = Mission()
    sensors: Sensors = Sensors()
    applications: tuple[ForeignApplication, ...] = ()
    """Applications of other packages, called in this order, after those of fanet-mw."""
    faults: tuple[AnyFault, ...] = ()
    """Changes of the air at given instants; `fanet air` makes them by message."""
    orders: tuple[PlannedOrder, ...] = ()
    """Orders of the post on the ground; `fanet order` gives them while a swarm runs."""
    further_traffic: tuple[Traffic, ...] = ()
    """Further traffic classes: in a file, the second and all later `[[traffic]]`."""

    @model_validator(mode="before")
    @classmethod
    def _several_classes(cls, tree: object) -> object:
        """Several `[[traffic]]` in a file: the first one is `traffic`, the others are `further_traffic`."""
        if not isinstance(tree, Mapping) or not isinstance(tree.get("traffic"), list | tuple):
            return tree
        first, *others = tree["traffic"] or [{"arrivals": "none"}]
        return {**tree, "traffic": first, "further_traffic": [*others, *tree.get("further_traffic", ())]}

    @model_serializer(mode="wrap")
    def _as_in_a_file(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """All classes of traffic as one array, if there are several."""
        tree: dict[str, Any] = write(self)
        others = tree.pop("further_traffic", ())
        if others:
            tree["traffic"] = [tree.get("traffic", {}), *others]
        return tree

    @property
    def traffic_classes(self) -> Mapping[str, Traffic]:
        """All classes of traffic by their names, in the order of the file."""
        return {
            traffic.name or ("traffic" if index == 1 else f"traffic_{index}"): traffic
            for index, traffic in enumerate((self.traffic, *self.further_traffic), start=1)
        }

    @model_validator(mode="after")
    def _parts_agree(self) -> Self:
        problems = list(disagreements(self))
        if problems:
            raise ValueError("; ".join(problems))
        return self

    @property
    def rigid(self) -> bool:
        """True if no distance between UAVs changes: in formation or at rest, and no UAV approaches a survivor."""
        approach = self.mission.survivors > 0 and self.mission.reports_to_approach <= self.nodes.count
        return self.mobility.rigid and not approach

    @property
    def measures_links(self) -> bool:
        """True if timetables are made from measured links (`clusters.links`)."""
        chosen, lossy = self.clusters.links, self.radio.shadowing_db > 0 or self.radio.fading != "none"
        wanted = chosen == "measured" or (chosen == "auto" and lossy)
        return wanted and self.clusters.relay == "scheduled" and self.routing.hello_interval_s > 0

    @property
    def hears_load(self) -> bool:
        """True if timetables are made for the load that is heard (`clusters.load`)."""
        return self.clusters.load == "heard" and self.clusters.relay == "scheduled"

    @property
    def longest_bulk_bytes(self) -> int:
        """The longest packet of the traffic classes that are bulk; 0 if there are none."""
        return max((each.longest_bytes for each in self.traffic_classes.values() if each.priority == "bulk"), default=0)

    @property
    def repair_ns(self) -> int:
        chosen = self.clusters.repair_s
        if chosen == "auto":
            chosen = _REPAIR_S if self.clusters.relay == "counter" or self.measures_links else 0.0
        return seconds_to_ns(chosen)

    @property
    def saturated(self) -> bool:
        return any(traffic.arrivals == "saturated" for traffic in self.traffic_classes.values())

    @property
    def mac_lifetime_ns(self) -> int:
        """The time for which a frame may wait in the MAC queue (`radio.lifetime_ms`)."""
        unset_ms = _FOREVER_MS if self.saturated else _LIFETIME_MS
        return round((self.radio.lifetime_ms or unset_ms) * MS)

    @property
    def duration_ns(self) -> int:
        return seconds_to_ns(self.duration_s)

    @property
    def traffic_window_ns(self) -> tuple[int, int]:
        """Application packets are generated, and measured, in [start, end)."""
        return seconds_to_ns(self.warmup_s), seconds_to_ns(self.duration_s - self.drain_s)

    @property
    def planned_faults(self) -> list[tuple[int, Control]]:
        """(instant ns, what happens), in the order of the file."""
        return [(seconds_to_ns(fault.at_s), fault.control()) for fault in self.faults]

    def planned_stops(self, node: int) -> list[tuple[int, int | None]]:
        """When the program of a node ends [ns], and when it is started again; None if it is not."""
        return stops_of(self.planned_faults, node)

    @property
    def post(self) -> NodeId | None:
        """The node of the post on the ground (`ground.at_m`); None if there is none."""
        return NodeId(self.nodes.count + 1) if self.ground.at_m else None

    @property
    def buildings_cut_links(self) -> bool:
        """True if a building between two nodes ends their link at once, whatever their distance."""
        there = bool(self.world.buildings or self.world.buildings_geojson)
        return there and self.radio.channel == "range" and bool(self.radio.obstruction_loss_db)

    @property
    def reaches(self) -> Mapping[NodeId, float]:
        """How many times as far as UAVs nodes reach that have an antenna of their own, as in free space."""
        return {} if self.post is None else {self.post: math.pow(10.0, self.ground.gain_dbi / 20)}

    @property
    def node_count(self) -> int:
        """The number of UAVs, and one for the post on the ground."""
        return self.nodes.count + bool(self.ground.at_m)

    @property
    def last_id(self) -> str:
        """The greatest node id, as sentences about a wrong one name it."""
        count = self.nodes.count
        return f"nodes.count = {count}" if self.post is None else f"{self.post}, the post on the ground"

    @property
    def node_ids(self) -> range:
        return range(1, self.node_count + 1)

    @property
    def uav_ids(self) -> range:
        return range(1, self.nodes.count + 1)

    @property
    def drains_batteries(self) -> bool:
        return self.sensors.battery_hz > 0 or self.world.engine == "rotors"

    @property
    def leader(self) -> NodeId:
        return NodeId(1)
