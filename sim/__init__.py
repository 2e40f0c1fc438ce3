"""Worlds and runs: what stands around the agents and the emulator of fanet-mw."""
