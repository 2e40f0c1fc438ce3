"""The bus between the processes of a swarm: its messages, their topics and their bytes."""
