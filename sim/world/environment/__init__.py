"""What stands in the world and blows through it: hills, buildings, rays against them, survivors, wind."""
