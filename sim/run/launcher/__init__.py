"""A swarm of real processes: how they are started, watched, restarted and ended."""
