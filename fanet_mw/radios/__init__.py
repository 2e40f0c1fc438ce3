"""Radios: what a node transmits through."""
