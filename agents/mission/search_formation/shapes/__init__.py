"""The shapes in which a search is flown: the contract of a shape, and a file for each."""
