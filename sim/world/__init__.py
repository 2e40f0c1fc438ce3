"""The simulated world: engines that move bodies, obstacles, lines of sight, survivors, sensors, and the world as an
actor.
"""
