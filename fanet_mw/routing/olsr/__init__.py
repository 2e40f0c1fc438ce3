"""OLSR (RFC 3626) behind the contract."""

from fanet_mw.routing.olsr.protocol import Olsr

__all__ = ["Olsr"]
