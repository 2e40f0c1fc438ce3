"""What happens to a signal between two antennas: path loss, shadowing, fading, and the error rates that result."""
