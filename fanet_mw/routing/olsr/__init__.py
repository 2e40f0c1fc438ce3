"""OLSR (RFC 3626), a rival behind the contract of routing protocols."""

from fanet_mw.routing.olsr.protocol import Olsr

__all__ = ["Olsr"]
