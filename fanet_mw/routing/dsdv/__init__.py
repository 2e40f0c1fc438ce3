"""DSDV (Perkins and Bhagwat, 1994), a rival behind the contract of routing protocols."""

from fanet_mw.routing.dsdv.protocol import Dsdv

__all__ = ["Dsdv"]
