"""GOSSIP3 keeps the contract of routing protocols; `pytest examples/swarm-parts/tests` with swarm-parts installed."""

from typing import ClassVar

from fanet_mw.testing.routing_contract import RoutingContract


class TestGossip3(RoutingContract):
    """Every test of the contract runs against it."""

    protocol = "gossip3"
    least_delivered = 0.9


class TestGossip3ThatNeverRelaysAtFirst(RoutingContract):
    """Only the second decision relays."""

    protocol = "swarm_parts.gossip3:Gossip3"
    options: ClassVar = {"p": 0.0, "k": 0}
    least_delivered = 0.9
