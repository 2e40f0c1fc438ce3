"""The applications that a UAV carries as its scenario asks: load, telemetry, and collision avoidance."""
