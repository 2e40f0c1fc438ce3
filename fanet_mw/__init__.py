"""fanet-mw: real-time middleware for swarms of UAVs. The sans-IO core, its hosts and its radios."""

__version__ = "0.1.0"
