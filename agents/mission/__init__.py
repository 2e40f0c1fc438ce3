"""Search and rescue on board one UAV, sans-IO.

`everyone` holds the paper's rule, by which whoever hears enough reports goes. The other modules are the planned search:
a pattern of lanes, a plan that hands them out, an auction of responders, a filter per phone, and the velocity to fly.
"""
