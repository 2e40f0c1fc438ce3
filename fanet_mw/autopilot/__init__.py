"""The door to a flight controller: what a UAV's computer hears of it, and what it commands."""
