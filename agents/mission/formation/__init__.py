"""The search pattern: where its places are, which UAV takes which, and where the place of one UAV is now."""
