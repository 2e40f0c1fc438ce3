"""Which nodes pass a flooded packet on."""
