"""Swarm time: a common time that the nodes agree on over the air."""
