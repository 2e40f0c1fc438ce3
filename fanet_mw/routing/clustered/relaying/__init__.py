"""Relaying in contention: which nodes pass on a flooded packet, and when.

`contending` follows the rules of `gossip_and_counter`, or those of `gateways_cds_mpr`, which know two hops. Relaying in
turns is in `timetable/`.
"""
