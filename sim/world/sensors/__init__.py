"""What UAVs sense of the world: one module per kind of sensor, each behind the contract of `contract.py`."""
