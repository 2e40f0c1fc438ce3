"""The scenario of a run: its model, the tables it is made of, and how it is read from a TOML file.

Each table is in the file of its name: `[radio]` in `radio.py`. The model is re-exported here. The other files:

    model.py, sections.py        the whole scenario; what all of its tables have in common
    checks.py                    what the tables allow together
    config.py, quantities.py     reading from files and settings; units that a value may be written with
    commented.py, reference.py   a file with every key explained; what can be said of each key
    fingerprint.py                  whether two processes run the same scenario
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
