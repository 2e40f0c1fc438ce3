"""A common time for the swarm, agreed on over the air."""
