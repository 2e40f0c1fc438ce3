"""DSDV (Perkins and Bhagwat, 1994) behind the contract."""

from fanet_mw.routing.dsdv.protocol import Dsdv

__all__ = ["Dsdv"]
