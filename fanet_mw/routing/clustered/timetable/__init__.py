"""Timetables of collision-free floods: computed from positions or from measured links, followed by every node."""
