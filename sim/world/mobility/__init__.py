"""The flight of UAVs: their starts, one module per mobility model behind `contract.py`, and the flight controllers."""
