"""Routing protocols behind the contract of the core, by the name a scenario gives."""

from collections.abc import Callable, Mapping
from typing import Final

from fanet_mw.extensions import load
from fanet_mw.node.contract import Port, RoutingProtocol
from fanet_mw.routing.aodv import Aodv
from fanet_mw.routing.clustered.build import make_clustered
from fanet_mw.routing.direct import Direct
from fanet_mw.routing.dsdv import Dsdv
from fanet_mw.routing.flooding import Flooding
from fanet_mw.routing.geographic import Geographic
from fanet_mw.routing.olsr import Olsr
from fanet_mw.routing.storm import CounterBased, Gossip

PROTOCOLS: Final[Mapping[str, Callable[[Port], RoutingProtocol]]] = {
    "direct": Direct,
    "flooding": Flooding,
    "clustered": make_clustered,
    "aodv": Aodv,
    "olsr": Olsr,
    "dsdv": Dsdv,
    "gossip": Gossip,
    "counter": CounterBased,
    "geographic": Geographic,
}


def make_protocol(port: Port) -> RoutingProtocol:
    """The protocol that the port's scenario names."""
    name = port.scenario.routing.protocol
    made: RoutingProtocol = (PROTOCOLS.get(name) or load("routing.protocol", name))(port)
    return made
