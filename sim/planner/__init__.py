"""Analysis before take-off: whether a scenario is feasible, which delays its traffic gets, and what would help."""
