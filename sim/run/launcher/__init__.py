"""A swarm as processes: what is started, how it is watched, what died, and how everything ends."""
