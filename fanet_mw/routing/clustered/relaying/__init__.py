"""Relaying in contention: which nodes pass on a flooded packet, and when. Relaying in turns is in `timetable/`."""
