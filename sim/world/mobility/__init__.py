"""Where UAVs fly: their starts, one module per mobility model behind `contract.py`, and the guidance by it."""
