"""What a plan before take-off needs from the emulator: the links and the losses that its channel model expects."""
