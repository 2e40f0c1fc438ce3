"""TDMA: `slot_timing` and `turn_timing`: when a node may transmit; `hello_room`: whether hellos fit the window."""
