"""The formation of a planned search: its shape, which UAV takes which place, and where a UAV's place is now."""
