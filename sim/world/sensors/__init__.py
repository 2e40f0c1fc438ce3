"""The sensors of UAVs: one module per kind, each behind the contract of `contract.py`."""
