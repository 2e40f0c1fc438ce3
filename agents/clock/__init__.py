"""The clock of a UAV: its oscillator, how it finds swarm time, and the translation between the two."""
