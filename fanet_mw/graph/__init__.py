"""Graphs of the nodes that hear each other, as plain values: neighborhoods, relays, dominating sets. Pure functions."""
