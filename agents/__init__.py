"""The UAV process: routing core, autopilot, traffic and mission of one node."""
