"""Roles: which node leads the swarm, which nodes head clusters, and how failed leaders and heads are replaced."""
