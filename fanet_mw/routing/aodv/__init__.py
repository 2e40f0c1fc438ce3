"""AODV (RFC 3561), a rival behind the contract of routing protocols."""

from fanet_mw.routing.aodv.protocol import Aodv

__all__ = ["Aodv"]
