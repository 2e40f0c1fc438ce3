"""The clock of a UAV: its oscillator, how it learns swarm time, and the conversion between the two."""
