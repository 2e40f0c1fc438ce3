"""One run of a scenario, in virtual time or as real processes, and what is collected from it."""
