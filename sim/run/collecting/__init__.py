"""Collects what the processes of a run in real time send over the bus: checks it, stores it on disk, reads it at the
end.
"""
