"""Which node leads the swarm, heads a cluster, or is a member, and what becomes of it when nodes fall silent."""
