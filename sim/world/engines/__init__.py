"""Engines that move the bodies, one module per value of `world.engine`, all behind `contract.py`; and batteries."""
