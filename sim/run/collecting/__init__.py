"""Collects what the processes of a run in real time send over the bus: checks it, and stores it on disk."""
