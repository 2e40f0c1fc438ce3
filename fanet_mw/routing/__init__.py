"""Routing protocols behind the contract of the core, by the name a scenario gives."""

from collections.abc import Mapping
from typing import Final

from fanet_mw.node.contract import Port, RoutingProtocol
from fanet_mw.routing.aodv import Aodv
from fanet_mw.routing.clustered.claimed.protocol import Claimed
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.routing.clustered.scheduled import Scheduled
from fanet_mw.routing.clustered.selective import Selective
from fanet_mw.routing.direct import Direct
from fanet_mw.routing.dsdv import Dsdv
from fanet_mw.routing.flooding import Flooding
from fanet_mw.routing.geographic import Geographic
from fanet_mw.routing.olsr import Olsr
from fanet_mw.routing.storm import CounterBased, Gossip

PROTOCOLS: Final[Mapping[str, type[RoutingProtocol]]] = {
    "direct": Direct,
    "flooding": Flooding,
    "clustered": Clustered,
    "aodv": Aodv,
    "olsr": Olsr,
    "dsdv": Dsdv,
    "gossip": Gossip,
    "counter": CounterBased,
    "geographic": Geographic,
}


RELAYS: Final[Mapping[str, type[Clustered]]] = {
    "scheduled": Scheduled,
    "claimed": Claimed,
    "heads": Selective,
    "cds": Selective,
    "mpr": Selective,
}
"""Rules of `clusters.relay` that need more than `clustered` itself does."""


def make_protocol(port: Port) -> RoutingProtocol:
    """The protocol that the port's scenario names."""
    name = port.scenario.routing.protocol
    if name == "clustered":
        return RELAYS.get(port.scenario.clusters.relay, Clustered)(port)
    return PROTOCOLS[name](port)
