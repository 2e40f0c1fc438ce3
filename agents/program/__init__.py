"""A node of a swarm inside a program of one's own: `fanet_mw.join`."""
