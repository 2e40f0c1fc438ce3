"""Where a UAV is, where its neighbors are, the map that it carries, and the ways around what it knows of."""
