"""The flight of a searching UAV: to its goal, clear of others and obstacles, within reach of neighbors, and home."""
