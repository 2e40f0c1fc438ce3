"""What a swarm says, message by message: counted, decoded, and followed from node to node."""
