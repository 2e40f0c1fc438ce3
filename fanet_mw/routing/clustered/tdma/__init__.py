"""TDMA: when a node may transmit (slots of heads, turns of a timetable), and the queues that are emptied then."""
