"""The scenario of a run: its model, the tables it is made of, and how it is read from a TOML file."""

from fanet_mw.scenario.model import Scenario
from fanet_mw.scenario.tables.clock import Clock
from fanet_mw.scenario.tables.clusters import Clusters
from fanet_mw.scenario.tables.mission import Mission
from fanet_mw.scenario.tables.mobility import Mobility
from fanet_mw.scenario.tables.nodes import Nodes, grid_columns
from fanet_mw.scenario.tables.radio import Radio
from fanet_mw.scenario.tables.routing import LEAST_HELLO_S, HelloInterval, Routing
from fanet_mw.scenario.tables.traffic import Traffic
from fanet_mw.scenario.tables.world import Building, World

__all__ = [
    "Building",
    "Clock",
    "Clusters",
    "HelloInterval",
    "LEAST_HELLO_S",
    "Mission",
    "Mobility",
    "Nodes",
    "Radio",
    "Routing",
    "Scenario",
    "Traffic",
    "World",
    "grid_columns",
]
