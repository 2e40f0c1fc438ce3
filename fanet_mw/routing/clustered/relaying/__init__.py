"""Relaying: which nodes pass on a flooded packet, and when.

`contending` relays in contention by one of the `rules`, or by `neighbor_knowledge` of two hops (`neighborhood`);
`scheduled` relays in turns of a timetable, `claimed` in claimed turns.
"""
