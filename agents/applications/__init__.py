"""Applications that every UAV may carry: the traffic load, telemetry, and collision avoidance."""
