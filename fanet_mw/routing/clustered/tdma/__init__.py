"""Which node may send when: slots of heads, turns of the timetable, and the queues that are let out in them."""
