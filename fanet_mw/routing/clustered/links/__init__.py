"""What a node knows of links and loads: `link_quality` measured, `link_state` at the leader, `heard_load` of others."""
