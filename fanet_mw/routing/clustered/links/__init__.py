"""What a node knows of links and loads: `link_quality` (measured), `link_state` (the swarm's, at the leader),
`heard_load` (what others send).
"""
