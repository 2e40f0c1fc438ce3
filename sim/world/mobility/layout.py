"""Where the nodes of a scenario start, for experiments that choose nodes by their place."""

from sim.world.environment.layout import positions

__all__ = ["positions"]
