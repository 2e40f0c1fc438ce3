"""Relaying rules: which nodes pass on a flooded packet, and when."""
