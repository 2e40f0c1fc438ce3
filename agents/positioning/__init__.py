"""The position of a UAV where GPS alone does not tell it: averaged fixes, and dead reckoning."""
