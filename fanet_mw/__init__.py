"""fanet-mw: real-time middleware for swarms of UAVs.

What `__all__` names, here and in `fanet_mw.testing`, is the public interface: it changes only with a new minor version,
and the changelog says how (docs/how-to/send-messages.md). Everything else is private. Names are loaded when they are
first used: `import fanet_mw` costs nothing, and what needs numpy says so when it is asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from agents.program.attached import Emulated, NodeClosedError, OnAir
    from agents.program.joined import Node, join
    from agents.program.mailbox import Message, Sent
    from fanet_mw.application import ANY, HOME, Application, AppPort, Course, Data, Fate, Received, Status
    from fanet_mw.bus.messages import (
        Altimeter,
        Battery,
        Camera,
        CameraImage,
        FlightState,
        Gps,
        Inertial,
        LandingTarget,
        Radar,
        SensorReading,
        Voice,
        WifiScan,
        WindEstimate,
    )
    from fanet_mw.errors import BusError, ConfigError, DropReason, FanetError, LocalProtocolError, MalformedFrameError
    from fanet_mw.scenario import Scenario
    from fanet_mw.units import BROADCAST, Enu, NodeId
    from sim.results.result import Result, load_result
    from sim.run.api import Launched, launch, simulate
    from sim.run.virtual_swarm import VirtualSwarm
    from sim.scenarios.catalog import find as load_scenario

__version__ = "0.1.0"

_HOMES: Final = {
    "agents.program.attached": ("Emulated", "NodeClosedError", "OnAir"),
    "agents.program.joined": ("Node", "join"),
    "agents.program.mailbox": ("Message", "Sent"),
    "fanet_mw.application": (
        "ANY", "HOME", "AppPort", "Application", "Course", "Data", "Fate", "Received", "Status",
    ),
    "fanet_mw.bus.messages": (
        "Altimeter", "Battery", "Camera", "CameraImage", "FlightState", "Gps", "Inertial", "LandingTarget", "Radar",
        "SensorReading", "Voice", "WifiScan", "WindEstimate",
    ),
    "fanet_mw.errors": (
        "BusError", "ConfigError", "DropReason", "FanetError", "LocalProtocolError", "MalformedFrameError",
    ),
    "fanet_mw.scenario": ("Scenario",),
    "fanet_mw.units": ("BROADCAST", "Enu", "NodeId"),
    "sim.run.api": ("Launched", "launch", "simulate"),
    "sim.results.result": ("Result", "load_result"),
    "sim.run.virtual_swarm": ("VirtualSwarm",),
}  # fmt: skip
"""The module of each public name. The packages above this one are named here and imported by nothing else in it."""
_HOME_OF: Final = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "Altimeter", "ANY", "Application", "AppPort", "Battery", "BROADCAST", "BusError", "Camera", "CameraImage",
    "ConfigError", "Course", "Data", "DropReason", "Emulated", "Enu", "FanetError", "Fate", "FlightState", "Gps",
    "HOME", "Inertial", "LandingTarget", "Launched", "LocalProtocolError", "MalformedFrameError", "Message", "Node",
    "NodeClosedError", "NodeId", "OnAir", "Radar", "Received", "Result", "Scenario", "SensorReading", "Sent", "Status",
    "VirtualSwarm", "Voice", "WifiScan", "WindEstimate", "__version__", "join", "launch", "load_result",
    "load_scenario", "simulate",
]  # fmt: skip


def __getattr__(name: str) -> Any:  # noqa: ANN401  (whatever the name stands for)
    if name not in __all__:
        raise AttributeError(f"module 'fanet_mw' has no attribute {name!r}")
    try:
        if name == "load_scenario":
            value = import_module("sim.scenarios.catalog").find
        else:
            value = getattr(import_module(_HOME_OF[name]), name)
    except (ImportError, AttributeError) as error:
        from fanet_mw.installation import damage, missing_extra

        extra = missing_extra(error, f"fanet_mw.{name}") if isinstance(error, ModuleNotFoundError) else None
        if extra is not None:
            raise ModuleNotFoundError(extra, name=error.name) from error
        if (why := damage()) is None:
            raise
        raise ImportError(f"fanet_mw.{name}: {why}") from error
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
