"""The scenario of a run: its model, the tables it is made of, and how it is read from a TOML file.

Each table is in a file of its name. The model is re-exported here.
"""

from fanet_mw.scenario.clock import Clock
from fanet_mw.scenario.clusters import Clusters
from fanet_mw.scenario.mission import Mission
from fanet_mw.scenario.mobility import Mobility
from fanet_mw.scenario.model import Scenario
from fanet_mw.scenario.nodes import Nodes, grid_columns
from fanet_mw.scenario.radio import Radio
from fanet_mw.scenario.routing import LEAST_HELLO_S, HelloInterval, Routing
from fanet_mw.scenario.traffic import Traffic
from fanet_mw.scenario.world import Building, World

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
