"""Wireshark's dissector for captures, made by scripts/generate_dissector.py."""
