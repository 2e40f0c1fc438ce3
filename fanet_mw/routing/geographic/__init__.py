"""Geographic carry-and-forward routing, a rival behind the contract of routing protocols."""

from fanet_mw.routing.geographic.protocol import Geographic

__all__ = ["Geographic"]
