"""The flight of a searching UAV: to its goal, clear of others and of obstacles, within reach of its neighbors, and
home.
"""
