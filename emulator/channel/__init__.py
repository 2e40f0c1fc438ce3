"""The channel between two antennas: path loss, shadowing, fading, and the error rates that result."""
