"""Sweeps: many runs in virtual time, each with its settings and seed, and one table of what came out of them."""
