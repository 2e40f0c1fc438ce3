"""Sweeps: many runs with different settings and seeds, and one table of their results."""
