"""One run of a scenario, in virtual time or as real processes, and the collection of its results."""
