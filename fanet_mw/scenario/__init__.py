"""The scenario of a run: its model, the tables it is made of, and how it is read from a TOML file.

model.py, tables/            the whole scenario; each of its tables: `[radio]` in `tables/radio.py`
cross_checks.py              what the tables allow together
config.py                    reading from files; settings as `--set KEY=VALUE`
quantities.py                units that a value may be written with
validation_errors.py         what the user reads of a scenario that is not valid
commented.py, reference.py   a file with every key explained; what can be said of each key
fingerprint.py               whether two processes run the same scenario
named_files.py               digests of the files that it names, and the place of a map on earth
ascii_grid.py, outlines.py   headers of grids of heights; outlines of buildings
"""

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
