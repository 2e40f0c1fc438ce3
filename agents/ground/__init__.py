"""The post on the ground: a node without a vehicle, which learns what the swarm finds and gives orders."""
