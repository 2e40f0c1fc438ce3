"""The routing protocols, by the names that scenarios give them (`routing.protocol`).

A protocol is imported only when a scenario chooses it.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Final

from fanet_mw.extensions import load, make
from fanet_mw.node.contract import Port, RoutingProtocol

Maker = Callable[[Port], RoutingProtocol]
MAKERS: Final[Mapping[str, str]] = {
    "direct": "fanet_mw.routing.direct:Direct",
    "flooding": "fanet_mw.routing.flooding:Flooding",
    "rounds": "fanet_mw.routing.rounds.rounds:RoundFlooding",
    "clustered": "fanet_mw.routing.clustered.build:make_clustered",
    "aodv": "fanet_mw.routing.aodv:Aodv",
    "olsr": "fanet_mw.routing.olsr:Olsr",
    "dsdv": "fanet_mw.routing.dsdv:Dsdv",
    "gossip": "fanet_mw.routing.gossip:Gossip",
    "counter": "fanet_mw.routing.counter:CounterBased",
    "geographic": "fanet_mw.routing.geographic:Geographic",
}
"""The class or function that makes each protocol of this package (`scenario.routing.PROTOCOLS`), as MODULE:NAME."""


def module_of(name: str) -> str:
    """The name of the module of a protocol; a protocol of this package is not imported for it."""
    return MAKERS[name].partition(":")[0] if name in MAKERS else str(maker_of(name).__module__)


def maker_of(name: str) -> Maker:
    """The class or function that makes the protocol of this name; it is imported now."""
    if name not in MAKERS:
        return load("routing.protocol", name)  # type: ignore[no-any-return]
    module, _, made = MAKERS[name].partition(":")
    return getattr(import_module(module), made)  # type: ignore[no-any-return]


def make_protocol(port: Port) -> RoutingProtocol:
    """The protocol that the scenario of this port names."""
    name = port.scenario.routing.protocol
    made: RoutingProtocol = maker_of(name)(port) if name in MAKERS else make("routing.protocol", name, port)
    return made
