"""The position of a UAV when GPS is inaccurate or out: averaged fixes, and dead reckoning."""
