"""AODV (RFC 3561) behind the contract."""

from fanet_mw.routing.aodv.protocol import Aodv

__all__ = ["Aodv"]
