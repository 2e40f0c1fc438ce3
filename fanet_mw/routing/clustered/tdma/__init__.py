"""TDMA: `slot_timing` and `turn_timing` say at which instants a node may transmit; `turn_release` is the queue that is
emptied in a turn.
"""
