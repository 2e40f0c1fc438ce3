"""A packet's way to its head and from there to everyone, and the repair of what was lost on it."""
