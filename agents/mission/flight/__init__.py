"""How a searching UAV flies: to its goal, clear of others and of obstacles, in reach of its neighbors, and home."""
