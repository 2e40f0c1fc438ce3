"""TDMA: when a node may transmit (slots of heads, turns of a timetable), and the queues that are emptied then.

`slot_timing`, `turn_timing` and `contention_timing` say at which instants; `slot_release` and `turn_release` are the
queues. By `slot_access` members send packets to their head, which floods them in its slot.
"""
