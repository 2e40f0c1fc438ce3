"""The world around a swarm: engines, obstacles, sight, survivors, and the world as an actor and a process."""
