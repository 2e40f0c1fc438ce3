"""Geographic carry-and-forward routing behind the contract."""

from fanet_mw.routing.geographic.protocol import Geographic

__all__ = ["Geographic"]
