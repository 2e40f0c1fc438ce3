"""Baseline protocols behind the contract of the core."""
