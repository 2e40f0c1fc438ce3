"""The surroundings of a swarm: hills, buildings, rays against them, survivors, and wind."""
