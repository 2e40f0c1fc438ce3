"""What can be seen of a swarm from outside, live or again: its state at an instant, made of messages and records."""
