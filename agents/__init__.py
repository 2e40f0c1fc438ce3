"""The UAV process of fanet-mw: routing core, autopilot, traffic and mission of one node."""
