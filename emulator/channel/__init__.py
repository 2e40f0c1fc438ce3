"""What becomes of a signal between two antennas: path loss, shadowing, fading, error rates."""
