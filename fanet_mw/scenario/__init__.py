"""The scenario of a run: its model, the tables it is made of, and how it is read from a TOML file.

The model is re-exported here.
"""

from fanet_mw.scenario.clock import Clock
from fanet_mw.scenario.model import (
    LEAST_HELLO_S,
    Building,
    Clusters,
    HelloInterval,
    Mission,
    Mobility,
    Nodes,
    Routing,
    Scenario,
    Traffic,
    World,
    grid_columns,
)
from fanet_mw.scenario.radio import Radio

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
