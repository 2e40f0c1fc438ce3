"""TDMA: `slot_timing` and `turn_timing` say at which instants a node may transmit, `hello_room` whether hellos fit the
contention window.
"""
