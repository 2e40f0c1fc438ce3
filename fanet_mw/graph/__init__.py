"""Graphs of who hears whom, as plain values: neighborhoods, colorings, dominating sets. Pure functions."""
