"""The flight of UAVs: their starts, the mobility models behind `contract.py`, and the flight controllers."""
