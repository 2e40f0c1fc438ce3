"""What moves the bodies: one module per value of `world.engine` behind `contract.py`, and batteries."""
