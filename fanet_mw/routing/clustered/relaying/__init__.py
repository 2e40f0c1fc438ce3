"""Relaying: which nodes pass on a flooded packet, and when.

`contending` relays in contention by the rules of `gossip_and_counter`, or by those of `gateways_cds_mpr`, which know
two hops (`neighborhood`); `scheduled` relays in turns of a timetable, `claimed` in claimed turns.
"""
