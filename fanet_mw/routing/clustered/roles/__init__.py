"""Who leads the swarm, who heads a cluster, who is a member, and what becomes of them when nodes fall silent."""
