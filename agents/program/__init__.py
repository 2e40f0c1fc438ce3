"""A node of a swarm inside a user's own program (`fanet_mw.join`)."""
