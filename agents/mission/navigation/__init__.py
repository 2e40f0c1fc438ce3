"""Navigation: the UAV's own motion, the motions of its neighbors, its map, and ways around known obstacles."""
