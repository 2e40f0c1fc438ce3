"""Roles: which node leads the swarm, which nodes head clusters, and how failed leaders and heads are replaced.

every node    `joining` asks the leader for a place, `position_updates` tell where the node is, `membership` is its
              cluster by the newest schedule, `schedule_refresh` passes that on, `schedule_check` refuses forged ones
the leader    `leader` divides the nodes that the `roster` knows, and announces the schedule
failures      `liveness`, `deafness`, `head_failure_detector`, `neighbor_failure_detector`, `leader_election`;
              `failover` finds what has happened, and the table in `states` says what a node does then
all together  `assigned_roles`
"""
