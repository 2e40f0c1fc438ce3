"""How a packet gets to a cluster head and from there to all nodes, and how lost packets are repaired."""
